"""From MuJoCo's contacts to fingertip touches, in our order, frame and sign: the only place the controller's side knows them.

MuJoCo's contact frame has its normal from geom[0] to geom[1] and `mj_contactForce` acts on geom[1]; a Touch has its normal
**into the object** and its force **on the object**, whichever way round the pair was found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.scene.scene import Scene
from dexplan.spatial import Array, cross, lock_arrays


@dataclass(frozen=True, eq=False)
class Touches:
    """The contact of each fingertip with the object at one instant; rows of fingers without contact are NaN.

    ``active`` (F,); ``point_O`` (F, 3) [m] and ``rotation_O`` (F, 3, 3), columns t1, t2, n (into the object), in the object
    frame; ``force`` (F, 4) = (f_t1, f_t2, f_n, tau_n) [N, N m] on the object in that frame; ``slip_velocity`` (F, 3) = two
    tangential [m/s] and the spin [rad/s] of the tip's surface relative to the object's; ``penetration`` (F,) [m];
    ``pole_angle`` (F,) [rad] between the tip's pole and the contact on the tip.
    """

    active: NDArray[np.bool_]
    point_O: Array
    rotation_O: Array
    force: Array
    slip_velocity: Array
    penetration: Array
    pole_angle: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def read_touches(scene: Scene, data: mujoco.MjData) -> Touches:
    """Return every fingertip's contact with the object, the deepest where there are several."""
    model, n = scene.model, scene.n_fingers
    active = np.zeros(n, dtype=bool)
    point, rotation = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    force, slip = np.full((n, 4), np.nan), np.full((n, 3), np.nan)
    penetration, pole_angle = np.full(n, np.nan), np.full(n, np.nan)
    if data.ncon:
        deepest = _find_contacts(scene, data)
        # Each access to these makes an array; once is enough.
        frames, points = data.contact.frame, data.contact.pos
        R_WO, p_WO = data.xmat[scene.object_body].reshape(3, 3), data.xpos[scene.object_body]
        wrench = np.zeros(6)
        for i, (k, distance, is_object_second) in deepest.items():
            R_CW, p_W = frames[k].reshape(3, 3), points[k]
            mujoco.mj_contactForce(model, data, k, wrench)
            # Object second: normal and force are already ours.  Object first: turn both about the first tangent.
            sign = 1.0 if is_object_second else -1.0
            R_WC = np.stack([R_CW[1], sign * R_CW[2], sign * R_CW[0]], axis=1)
            v, w = _point_velocity(model, data, int(model.geom_bodyid[scene.tip_geoms[i]]), p_W)
            v_object, w_object = _point_velocity(model, data, scene.object_body, p_W)
            active[i] = True
            point[i] = (p_W - p_WO) @ R_WO
            rotation[i] = R_WO.T @ R_WC
            force[i, :3] = (sign * (wrench[:3] @ R_CW)) @ R_WC
            force[i, 3] = (sign * (wrench[3:] @ R_CW)) @ R_WC[:, 2]
            slip[i, :2] = ((v - v_object) @ R_WC)[:2]
            slip[i, 2] = (w - w_object) @ R_WC[:, 2]
            penetration[i] = -distance
            pole = data.site_xmat[scene.tip_sites[i]][2::3]
            across = cross(pole, R_WC[:, 2])
            pole_angle[i] = math.atan2(math.sqrt(across.dot(across)), float(pole.dot(R_WC[:, 2])))
    return Touches(active, point, rotation, force, slip, penetration, pole_angle)


class _Deepest(NamedTuple):
    """A finger's deepest contact: its row in MuJoCo's list, distance [m], and whether the object is geom[1]."""

    row: int
    distance: float
    is_object_second: bool


def _find_contacts(scene: Scene, data: mujoco.MjData) -> dict[int, _Deepest]:
    """Return the deepest contact of each finger that touches."""
    finger_of = {int(geom): i for i, geom in enumerate(scene.tip_geoms)}
    found: dict[int, _Deepest] = {}
    rows = zip(
        data.contact.geom.tolist(), data.contact.dist.tolist(), data.contact.efc_address.tolist(), strict=True
    )
    for k, ((first, second), distance, address) in enumerate(rows):
        if address < 0 or scene.object_geom not in (first, second):
            continue
        i = finger_of.get(first if second == scene.object_geom else second)
        if i is not None and (i not in found or distance < found[i].distance):
            found[i] = _Deepest(k, distance, second == scene.object_geom)
    return found


def compute_static_normal_force(scene: Scene, data: mujoco.MjData, finger: int) -> float:
    """Return the normal force [N] that the finger's contact would carry if everything stood still at this depth.

    At rest MuJoCo's soft contact gives ``f = D aref``, its stiffness times the depth.  Needs constraints made by mj_forward;
    0 where the finger does not touch.
    """
    for k in range(data.ncon):
        if set(data.contact.geom[k]) == {scene.tip_geoms[finger], scene.object_geom}:
            row = data.contact.efc_address[k]
            return float(data.efc_D[row] * data.efc_aref[row]) if row >= 0 else 0.0
    return 0.0


def _point_velocity(model: mujoco.MjModel, data: mujoco.MjData, body: int, p_W: Array) -> tuple[Array, Array]:
    # cvel is (w, v) about the centre of mass of the body's whole tree, in world axes.
    w, v = data.cvel[body, :3], data.cvel[body, 3:]
    return v + cross(w, p_W - data.subtree_com[model.body_rootid[body]]), w
