"""MuJoCo's renderer: a model that is drawn, a pose, one or two cameras, and marks that stand in the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from dexplan.contact.bodies.body import ConvexBody
from dexplan.errors import UnknownNameError
from dexplan.spatial import Array, make_pose
from dexplan.viz.body import SURFACE
from dexplan.viz.film import CLOSE_UP, Quality
from dexplan.viz.palette import as_rgb
from dexplan.viz.pattern import measure_slenderness

SIGHT = 1.3
"""The close-up shows all of the object and, above and below it, so much of how far its nearest side is from its centre."""
CLOSE_FOV = 45.0
"""Of a free camera, MuJoCo's default [deg]."""
CLOSE_ELEVATION, CLOSE_AZIMUTH = -58.0, -60.0
"""From where the close-up looks [deg]: like ``overview``, from between two fingers near this azimuth, and steeper."""
MOST_MARKS = 1200
GLOW, DIM = 0.15, 0.6
"""Light that marks give off themselves, so that they keep their colours on the dark side of things; share of a line's colour that
looks like all of it where there are shadows."""
SKYLINES = frozenset({"side"})
"""Cameras that see beyond the floor: the sky takes a quarter of a picture's time, and others do not see it."""


@dataclass(frozen=True)
class View:
    """One camera's part of a picture: the name of the camera, and ``left``, ``top``, ``width``, ``height`` [pixels]."""

    camera: str
    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True, eq=False)
class Projection:
    """How a camera maps the world onto its view: eye, axes (right, down, forward) as rows, pixels per unit slope, and middle."""

    eye: Array
    axes: Array
    scale: float
    middle: Array

    def project(self, p_W: ArrayLike) -> Array:
        """Return pixels (..., 2) of points (..., 3) [W]; NaN behind the camera."""
        q = (np.asarray(p_W, dtype=float) - self.eye) @ self.axes.T
        depth = np.where(q[..., 2] > 1e-3, q[..., 2], np.nan)
        found: Array = self.middle + self.scale * q[..., :2] / depth[..., None]
        return found


class Stage:
    """Draws poses of one model into parts of one picture.  A GL context has to be current.

    ``body`` is the object's, which a dressed model no longer tells; None where it is unknown.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        body: ConvexBody | None,
        size: tuple[int, int],
        views: Sequence[View],
        quality: Quality,
    ) -> None:
        known = [model.camera(k).name for k in range(model.ncam)]
        for view in views:
            if view.camera not in known and view.camera != CLOSE_UP:
                raise UnknownNameError("camera", view.camera, [*known, CLOSE_UP])
        self.model, self._views = model, tuple(views)
        self._top = min(view.top for view in views)
        self._bottom = max(view.top + view.height for view in views)
        model.vis.global_.offwidth, model.vis.global_.offheight = size[0], self._bottom - self._top
        model.vis.quality.numslices, model.vis.quality.numstacks = quality.slices, quality.slices // 2
        model.vis.quality.offsamples, model.vis.quality.shadowsize = quality.samples, quality.shadow
        self._data = mujoco.MjData(model)
        self._object = int(model.jnt_bodyid[model.joint("object/free/").id])
        self.body = body
        self._reach = _measure_reach(model, self.body)
        self._stand = choose_azimuth(model, self._object)
        self._option = mujoco.MjvOption()
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + MOST_MARKS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = quality.shadow > 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._scene.flags[mujoco.mjtRndFlag.mjRND_HAZE] = False
        # Where there are shadows, each light is drawn on its own: what glows would glow more than once, and lines, which face no
        # light, would get all of each.
        self._glow, self._dim = (0.0, DIM) if quality.shadow else (GLOW, 1.0)
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._rect = mujoco.MjrRect(0, 0, size[0], self._bottom - self._top)
        self._read = np.zeros((self._rect.height, size[0], 3), dtype=np.uint8)

    def close(self) -> None:
        """Give back what the renderer holds."""
        self._context.free()

    def set_pose(self, qpos: Array) -> None:
        """Put the model into a pose; marks of an earlier one go."""
        self._data.qpos[:] = qpos
        # All that a picture needs; forces come from the trace and are not computed again.
        mujoco.mj_kinematics(self.model, self._data)
        mujoco.mj_comPos(self.model, self._data)
        mujoco.mj_camlight(self.model, self._data)
        camera = self._aim(self._views[0])
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self.model, self._data, self._option, None, camera, every, self._scene)

    def find_object(self) -> Array:
        """Return the object's pose (4, 4) in the world."""
        return self.find_body(self._object)

    def find_body(self, body: int) -> Array:
        """Return a body's pose (4, 4) in the world."""
        return make_pose(self._data.xmat[body].reshape(3, 3), self._data.xpos[body])

    def draw_into(self, pixels: NDArray[np.uint8]) -> tuple[Projection, ...]:
        """Draw every view into ``pixels`` (H, W, 3 or more); return how each maps the world."""
        projections = []
        for view in self._views:
            mujoco.mjv_updateCamera(self.model, self._data, self._aim(view), self._scene)
            self._scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = view.camera in SKYLINES
            rect = mujoco.MjrRect(view.left, self._bottom - view.top - view.height, view.width, view.height)
            mujoco.mjr_render(rect, self._scene, self._context)
            projections.append(self._find_projection(view))
        # Once for all views, since each reading smooths the edges of the whole picture.
        mujoco.mjr_readPixels(self._read, None, self._rect, self._context)
        pixels[self._top : self._bottom, :, :3] = self._read[::-1]
        return tuple(projections)

    def add_ball(self, p_W: Array, radius: float, color: str, opacity: float = 1.0) -> None:
        """Add a ball to the world."""
        geom = self._add(mujoco.mjtGeom.mjGEOM_SPHERE, color, opacity)
        if geom is not None:
            geom.size[:], geom.pos[:] = radius, p_W

    def add_line(self, points_W: Array, width: float, color: str, opacity: float = 1.0) -> None:
        """Add a line through points (N, 3), ``width`` pixels thick."""
        kind = mujoco.mjtGeom.mjGEOM_LINE
        for start, end in pairwise(points_W):
            geom = self._add(kind, color, opacity)
            if geom is not None:
                mujoco.mjv_connector(geom, kind, width, start, end)

    def _add(self, kind: mujoco.mjtGeom, color: str, opacity: float) -> mujoco.MjvGeom | None:
        """Return the next free mark; None where there are too many."""
        if self._scene.ngeom >= self._scene.maxgeom:
            return None
        geom = self._scene.geoms[self._scene.ngeom]
        dim = self._dim if kind == mujoco.mjtGeom.mjGEOM_LINE else 1.0
        rgba = np.array([*(dim * as_rgb(color)), opacity], dtype=np.float32)
        mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
        geom.emission, geom.specular = self._glow, 0.0
        self._scene.ngeom += 1
        return geom

    def _aim(self, view: View) -> mujoco.MjvCamera:
        camera = mujoco.MjvCamera()
        if view.camera != CLOSE_UP:
            camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
            camera.fixedcamid = self.model.camera(view.camera).id
            return camera
        camera.lookat[:] = self._data.xpos[self._object]
        reach = self._reach * max(1.0, view.height / view.width)
        camera.distance = reach / np.tan(0.5 * np.radians(CLOSE_FOV))
        # MuJoCo names the direction in which a camera looks, not where it stands.
        camera.azimuth, camera.elevation = self._stand - 180.0, CLOSE_ELEVATION
        return camera

    def _find_projection(self, view: View) -> Projection:
        left, right = self._scene.camera[0], self._scene.camera[1]
        forward, up = np.array(left.forward), np.array(left.up)
        axes = np.stack([np.cross(forward, up), -up, forward])
        slope = (left.frustum_top - left.frustum_bottom) / left.frustum_near
        middle = np.array([view.left + 0.5 * view.width, view.top + 0.5 * view.height])
        eye = 0.5 * (np.array(left.pos) + np.array(right.pos))
        return Projection(eye, axes, view.height / slope, middle)


def _measure_reach(model: mujoco.MjModel, body: ConvexBody | None) -> float:
    """Return how far [m] from the object's centre the close-up sees."""
    if body is None:
        return (1.0 + SIGHT) * float(model.geom_rbound[model.geom(SURFACE).id])
    return body.bound + SIGHT * measure_slenderness(body)


def choose_azimuth(model: mujoco.MjModel, thing: int) -> float:
    """Return the azimuth [deg] from which the body ``thing`` is seen between two fingers, of all the nearest to the usual."""
    bases = [b for b in range(1, model.nbody) if model.body_parentid[b] == 0 and b != thing]
    arms = model.body_pos[bases, :2] - model.body_pos[thing, :2]
    stands = np.unique(np.degrees(np.arctan2(arms[:, 1], arms[:, 0])).round(3))
    if len(stands) == 0:
        return CLOSE_AZIMUTH
    gaps = np.diff(stands, append=stands[0] + 360.0)
    middles = (stands + 0.5 * gaps)[gaps > gaps.max() - 20.0]
    off = np.abs((middles - CLOSE_AZIMUTH + 180.0) % 360.0 - 180.0)
    return float(middles[np.argmin(off)])
