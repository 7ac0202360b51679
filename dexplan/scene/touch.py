"""From MuJoCo's contacts to fingertip touches, in our order, frame and sign: the only place the controller's side knows them.

MuJoCo's contact frame has its normal from geom[0] to geom[1] and `mj_contactForce` acts on geom[1]; a Touch has its normal
**into the object** and its force **on the object**, whichever way round the pair was found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.scene.scene import Scene
from dexplan.spatial import Array, cross


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


def read_touches(scene: Scene, data: mujoco.MjData) -> Touches:
    """Return every fingertip's contact with the object, the deepest where there are several."""
    model, n = scene.model, scene.n_fingers
    active = np.zeros(n, dtype=bool)
    point, rotation = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    force, slip = np.full((n, 4), np.nan), np.full((n, 3), np.nan)
    penetration, pole_angle = np.full(n, np.nan), np.full(n, np.nan)
    if data.ncon:
        geoms, dist = data.contact.geom, data.contact.dist
        R_WO = data.xmat[scene.object_body].reshape(3, 3)
        p_WO = data.xpos[scene.object_body]
        for i, tip in enumerate(scene.tip_geoms):
            pair = ((geoms[:, 0] == tip) & (geoms[:, 1] == scene.object_geom)) | (
                (geoms[:, 1] == tip) & (geoms[:, 0] == scene.object_geom)
            )
            hits = [int(k) for k in np.flatnonzero(pair) if data.contact.efc_address[k] >= 0]
            if not hits:
                continue
            k = min(hits, key=lambda h: dist[h])
            R_CW = data.contact.frame[k].reshape(3, 3)
            wrench = np.zeros(6)
            mujoco.mj_contactForce(model, data, k, wrench)
            # Object second: normal and force are already ours.  Object first: turn both about the first tangent.
            sign = 1.0 if geoms[k, 1] == scene.object_geom else -1.0
            R_WC = np.stack([R_CW[1], sign * R_CW[2], sign * R_CW[0]], axis=1)
            f_W, tau = sign * (R_CW.T @ wrench[:3]), sign * (R_CW.T @ wrench[3:])
            p_W = data.contact.pos[k]
            active[i] = True
            point[i] = R_WO.T @ (p_W - p_WO)
            rotation[i] = R_WO.T @ R_WC
            force[i] = [*(R_WC.T @ f_W), R_WC[:, 2] @ tau]
            v, w = _point_velocity(model, data, int(model.geom_bodyid[tip]), p_W)
            v_object, w_object = _point_velocity(model, data, scene.object_body, p_W)
            v, w = v - v_object, w - w_object
            slip[i] = [R_WC[:, 0] @ v, R_WC[:, 1] @ v, R_WC[:, 2] @ w]
            penetration[i] = -dist[k]
            pole = data.site_xmat[scene.tip_sites[i]][2::3]
            pole_angle[i] = math.atan2(
                float(np.linalg.norm(cross(pole, R_WC[:, 2]))), float(pole @ R_WC[:, 2])
            )
    return Touches(active, point, rotation, force, slip, penetration, pole_angle)


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
