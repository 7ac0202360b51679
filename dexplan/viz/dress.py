"""The model that is drawn: the one that was simulated, with what is only seen put on.

Collision geoms leave gaps where links must pass each other.  Parts that bridge them, the palm, the patterns on object and tips
and ghosts of the tips' collision spheres are added to a copy here, and not to the model itself: simulation neither pays for them
nor can be changed by them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.smooth import BallBody
from dexplan.spatial import Array
from dexplan.viz.body import SURFACE, find_body
from dexplan.viz.coat import Coat, build_coat
from dexplan.viz.palette import as_rgb, get_finger_color
from dexplan.viz.skins import build_cube_directions, paint_object, paint_tip

OBJECT_TEXELS, TIP_TEXELS = 256, 128
GHOST = 0.16
"""Opacity of the whole sphere with which a tip collides; of the tip itself only the front half is solid."""
GHOST_SHARE = 0.98
"""Of the radius is drawn, so that a ghost does not shade the faces of the tip inside it."""
FLOOR = (0.74, 0.76, 0.79, 1.0)
FLOOR_SIZE = (3.0, 3.0, 0.05)
"""A plain floor [m]: a pattern on it takes a software renderer as long as all the rest."""
COAT = "object/coat_seen"
UNSEEN = 4
"""The group of geoms that no film shows."""


@dataclass(frozen=True)
class Part:
    """A geom of a finger that is only seen, from ``start`` to ``end`` [m] in the frame of ``body``, of ``radius`` [m]."""

    name: str
    body: str
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radius: float
    material: str = "link"
    shape: mujoco.mjtGeom = mujoco.mjtGeom.mjGEOM_CAPSULE


CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER
PARTS = (
    Part("palm_seen", "", (0.0, 0.0, -0.187), (0.18, 0.0, -0.187), 0.013, "housing"),
    Part("hub_seen", "", (0.18, 0.0, -0.20), (0.18, 0.0, -0.172), 0.036, "housing", CYLINDER),
    Part("shoulder_seen", "", (0.0, 0.0, -0.022), (0.0, 0.0, 0.0), 0.010, "link", CYLINDER),
    Part("elbow_seen", "link_4", (0.0, 0.0, 0.0), (0.020, 0.026, 0.0), 0.0047),
    Part("bend_seen", "link_4", (0.090, 0.030, 0.0), (0.095, 0.026, 0.0), 0.0047),
    Part("fork_seen", "link_4", (0.095, 0.026, 0.0), (0.095, 0.0, 0.0), 0.0042),
    Part("stem_seen", "link_6", (0.0, 0.0, 0.0), (0.042, 0.0, 0.0), 0.0051),
)
"""Each finger reaches the middle of the hand with its third of the palm.  What lies along a collision geom is a little thicker,
for surfaces in one place flicker."""
WRIST = "link_6"
"""Only a finger with this body is the one that the parts belong to."""
ONCE = frozenset({"hub_seen"})
"""Parts of which one finger has enough for all."""


def dress_model(xml: str, fingers: tuple[str, ...]) -> mujoco.MjModel:
    """Return the model of the text ``xml`` as it is drawn; ``fingers`` are the names of its fingers.

    What it holds besides, it holds under the same names; positions (nq) mean the same.  Bodies, tips or textures that a
    model does not have stay away.
    """
    spec = mujoco.MjSpec.from_string(xml)
    body = find_body(xml)
    coat = _add_coat(spec, body)
    for k, finger in enumerate(fingers):
        if spec.body(f"{finger}/{WRIST}") is None:
            _color_rubber(spec, finger, as_rgb(get_finger_color(k)))
            continue
        _add_ghost(spec, finger, as_rgb(get_finger_color(k)))
        _add_parts(spec, finger, [part for part in PARTS if k == 0 or part.name not in ONCE])
    skins = [_add_skin(spec, finger) for finger in fingers]
    pattern = spec.texture("object/turning")
    is_painted = pattern is not None and coat is None
    if is_painted:
        pattern.width = pattern.height = OBJECT_TEXELS
    floor = spec.geom("floor")
    if floor is not None:
        floor.material, floor.rgba, floor.size = "", FLOOR, FLOOR_SIZE
    model = spec.compile()
    if is_painted:
        _paint(model, "object/turning", paint_object(build_cube_directions(OBJECT_TEXELS)))
    if coat is not None:
        _paint(model, COAT, coat.picture)
    for k, (finger, skin) in enumerate(zip(fingers, skins, strict=True)):
        if skin:
            colors = paint_tip(_find_tip_normals(model, finger), as_rgb(get_finger_color(k)))
            _paint(model, skin, colors)
    return model


def _add_coat(spec: mujoco.MjSpec, body: ConvexBody | None) -> Coat | None:
    """Put a coat over an object that is no ball, in whose place it is seen; return it, None where there is none."""
    if body is None or isinstance(body, BallBody):
        return None
    coat, surface = build_coat(body), spec.geom(SURFACE)
    texture = spec.add_texture(name=COAT, type=mujoco.mjtTexture.mjTEXTURE_2D)
    texture.builtin = mujoco.mjtBuiltin.mjBUILTIN_FLAT
    texture.width = texture.height = len(coat.picture)
    material = spec.add_material(name=COAT)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = COAT
    material.specular, material.shininess = 0.2, 0.3
    mesh = spec.add_mesh(name=COAT)
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    mesh.uservert, mesh.usernormal = coat.corners.ravel(), coat.normals.ravel()
    mesh.usertexcoord = coat.places.ravel()
    for faces in ("userface", "userfacenormal", "userfacetexcoord"):
        setattr(mesh, faces, coat.triangles.ravel())
    geom = surface.parent.add_geom()
    geom.name, geom.type, geom.meshname, geom.material = COAT, mujoco.mjtGeom.mjGEOM_MESH, COAT, COAT
    _make_unreal(geom)
    surface.group = UNSEEN
    return coat


def _add_parts(spec: mujoco.MjSpec, finger: str, parts: Sequence[Part]) -> None:
    for part in parts:
        body = spec.body(f"{finger}/{part.body}")
        if body is None:
            continue
        geom = body.add_geom()
        geom.name, geom.type = f"{finger}/{part.name}", part.shape
        geom.fromto = [*part.start, *part.end]
        geom.size = [part.radius, 0.0, 0.0]
        _make_unreal(geom)
        if spec.material(f"{finger}/{part.material}") is not None:
            geom.material = f"{finger}/{part.material}"


def _add_ghost(spec: mujoco.MjSpec, finger: str, color: Array) -> None:
    """Add the whole sphere as which a tip collides, to be seen through."""
    tip = spec.geom(f"{finger}/tip")
    if tip is None:
        return
    geom = tip.parent.add_geom()
    geom.name, geom.type = f"{finger}/ghost_seen", mujoco.mjtGeom.mjGEOM_SPHERE
    geom.pos, geom.size = tip.pos, [GHOST_SHARE * tip.size[0], 0.0, 0.0]
    geom.rgba = [*color, GHOST]
    _make_unreal(geom)


def _color_rubber(spec: mujoco.MjSpec, finger: str, color: Array) -> None:
    """Give the rubber of another kind of finger the colour of the finger."""
    rubber = spec.material(f"{finger}/rubber")
    if rubber is not None:
        rubber.rgba = [*color, 1.0]


def _make_unreal(geom: mujoco.MjsGeom) -> None:
    """Let a geom weigh nothing, touch nothing and be seen."""
    geom.contype = geom.conaffinity = 0
    geom.mass, geom.group = 0.0, 1


def _add_skin(spec: mujoco.MjSpec, finger: str) -> str:
    """Give the tip that is seen a texture of its own; return its name, nothing where there is no such tip."""
    tip = spec.geom(f"{finger}/tip_visual")
    if tip is None or spec.geom(f"{finger}/tip") is None:
        return ""
    name = f"{finger}/skin_seen"
    texture = spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_CUBE)
    texture.builtin = mujoco.mjtBuiltin.mjBUILTIN_FLAT
    texture.width = texture.height = TIP_TEXELS
    material = spec.add_material(name=name)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    # The texture is projected in metres of the mesh, not stretched to its box.
    material.texuniform = True
    material.specular, material.shininess = 0.1, 0.1
    tip.material = name
    return name


def _find_tip_normals(model: mujoco.MjModel, finger: str) -> Array:
    """Return where the texels of the tip's texture lie on its sphere: outward normals (6, n, n, 3), z towards its pole."""
    seen, tip = model.geom(f"{finger}/tip_visual"), model.geom(f"{finger}/tip")
    R_BM, R_BF = _as_matrix(seen.quat), _as_matrix(model.site(f"{finger}/tip_center").quat)
    rays_B = build_cube_directions(TIP_TEXELS) @ R_BM.T
    # A mesh has its origin in its centre of mass: from there, each ray meets the sphere once.
    offset, radius = seen.pos - tip.pos, float(tip.size[0])
    along = rays_B @ offset
    reach = -along + np.sqrt(np.maximum(along**2 - offset @ offset + radius**2, 0.0))
    normals: Array = ((offset + reach[..., None] * rays_B) / radius) @ R_BF
    return normals


def _paint(model: mujoco.MjModel, texture: str, colors: Array | NDArray[np.uint8]) -> None:
    k = model.texture(texture).id
    start, count = int(model.tex_adr[k]), colors.size
    model.tex_data[start : start + count] = colors.round().clip(0, 255).astype(np.uint8).ravel()


def _as_matrix(quat: Array) -> Array:
    flat = np.empty(9)
    mujoco.mju_quat2Mat(flat, np.asarray(quat, dtype=np.float64))
    return flat.reshape(3, 3)
