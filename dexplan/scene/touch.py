"""From MuJoCo's contacts to fingertip touches, in our order, frame and sign: the only place the controller's side knows them.

Touches are read by contact sensors of the simulator, one per fingertip, and for many instants at once: a run keeps its states,
and what touched what is evaluated afterwards.  A contact sensor that is asked for tip and object has its normal from tip to
object and its force on the object, whichever way round MuJoCo found the pair: a Touch has its normal **into the object** and its
force **on the object**.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.scene.scene import Scene
from dexplan.spatial import Array, lock_arrays

TOUCH_FIELDS = ("sensordata", "xpos", "xmat", "cvel", "subtree_com", "site_xmat")
"""What :func:`read_touches` needs of MjData, at each instant."""
_SENSED = ("found", "force", "torque", "dist", "pos", "normal", "tangent")
"""What a contact sensor gives, in this order: 1, 3, 3, 1, 3, 3 and 3 numbers."""
_WIDTH = 17
_NEAREST = 1
"""Of several contacts of a pair MuJoCo's sensor reports the deepest."""


@dataclass(frozen=True, eq=False)
class Touches:
    """The contact of each fingertip with the object at T instants; rows of fingers without contact are NaN.

    ``active`` (T, F); ``point_O`` (T, F, 3) [m] and ``rotation_O`` (T, F, 3, 3), columns t1, t2, n (into the object), in object
    axes; ``rotation_W`` the same in the world; ``force`` (T, F, 4) = (f_t1, f_t2, f_n, tau_n) [N, N m] on the object in that
    frame; ``slip_velocity`` (T, F, 3) = two tangential [m/s] and the spin [rad/s] of the tip's surface relative to the object's;
    ``penetration`` (T, F) [m]; ``pole_angle`` (T, F) [rad] between the tip's pole and the contact on the tip.
    """

    active: NDArray[np.bool_]
    point_O: Array
    rotation_O: Array
    rotation_W: Array
    force: Array
    slip_velocity: Array
    penetration: Array
    pole_angle: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


@lru_cache(maxsize=4)
def build_touch_model(scene: Scene) -> mujoco.MjModel:
    """Return the scene's model with a contact sensor per fingertip: the same physics, the same state."""
    spec = mujoco.MjSpec.from_string(scene.xml)
    for geom in scene.tip_geoms:
        sensor = spec.add_sensor(
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=scene.model.geom(geom).name,
            reftype=mujoco.mjtObj.mjOBJ_GEOM,
            refname=scene.model.geom(scene.object_geom).name,
        )
        sensor.intprm[:3] = [(1 << len(_SENSED)) - 1, _NEAREST, 1]
    return spec.compile()


def read_touches(scene: Scene, fields: Mapping[str, Array]) -> Touches:
    """Return every fingertip's contact with the object, the deepest where there are several.

    ``fields`` holds :data:`TOUCH_FIELDS` of T instants, as MuJoCo computes them for :func:`build_touch_model` (T, ...).
    """
    bodies, roots, ball = scene.model.geom_bodyid[scene.tip_geoms], scene.model.body_rootid, scene.object_body
    sensed = fields["sensordata"].reshape(-1, scene.n_fingers, _WIDTH)
    active = sensed[..., 0] > 0.0
    sensed = np.where(active[..., None], sensed, np.nan)
    p_W, n_W, t_W = sensed[..., 8:11], sensed[..., 11:14], sensed[..., 14:17]
    R_WC = np.stack([t_W, np.cross(n_W, t_W), n_W], axis=-1)
    R_WO, p_WO = fields["xmat"][:, ball].reshape(-1, 1, 3, 3), fields["xpos"][:, None, ball]

    def twist_at(body: NDArray[np.intp] | int) -> tuple[Array, Array]:
        # cvel is (w, v) about the centre of mass of the body's whole tree, in world axes.
        cvel, center = fields["cvel"][:, body], fields["subtree_com"][:, roots[body]]
        w = cvel[..., :3].reshape(len(sensed), -1, 3)
        v = cvel[..., 3:].reshape(w.shape)
        return v + np.cross(w, p_W - center.reshape(w.shape)), w

    (v, w), (v_object, w_object) = twist_at(bodies), twist_at(ball)
    spin = np.sum((w - w_object) * n_W, axis=-1)
    slide = np.einsum("tfij,tfi->tfj", R_WC[..., :2], v - v_object)
    pole = fields["site_xmat"][:, scene.tip_sites][..., 2::3]
    across = np.linalg.norm(np.cross(pole, n_W), axis=-1)
    return Touches(
        active=active,
        point_O=np.einsum("tfij,tfi->tfj", np.broadcast_to(R_WO, R_WC.shape), p_W - p_WO),
        rotation_O=np.swapaxes(R_WO, -1, -2) @ R_WC,
        rotation_W=R_WC,
        # The sensor gives force and torque in its frame, along the normal first.
        force=sensed[..., [2, 3, 1, 4]],
        slip_velocity=np.concatenate([slide, spin[..., None]], axis=-1),
        penetration=-sensed[..., 7],
        pole_angle=np.arctan2(across, np.sum(pole * n_W, axis=-1)),
    )


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
