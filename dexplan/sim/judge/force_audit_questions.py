"""From a replay to questions about forces: the contacts that were there, and the wrench that the object should have got.

The wrench is what gravity and the reference's acceleration ask for.  The measured acceleration would not
do: MuJoCo's own forces made it, so they always answer it, by letting the object fall if need be.
"""

from __future__ import annotations

from typing import final

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.sim.judge.force_audit_values import ForceQuestion
from dexplan.sim.judge.replay import Replay
from dexplan.sim.judge.world import Indices, World
from dexplan.spatial import Array


@final
class QuestionBuilder:
    """Asks for any sample of a replay whether the fingers that touch there could give the object what it should get.

    Friction, mass, gravity and torque limits are those of the compiled model and of the contacts that
    MuJoCo met: what is true, whatever a problem says.  The fingers' own acceleration is left out: what it
    takes is a few thousandths of the torque limits.

    Args:
        replay: of T samples.
        reference: object poses (T, 7) [m, wxyz, W] that should have been followed.
        sample_time: between samples [s].
        ceiling: greatest normal force of a finger [N].
    """

    def __init__(self, replay: Replay, reference: Array, sample_time: float, ceiling: float) -> None:
        self._replay, self._ceiling = replay, ceiling
        model = self._model = replay.world.model
        self._data = mujoco.MjData(model)
        self._twist_rate = compute_acceleration(
            reference, model.body_ipos[replay.world.object_body], sample_time
        )
        self._tips = model.geom_bodyid[replay.world.tip_geoms]
        self._servos = [_find_servos(replay.world, int(body)) for body in self._tips]
        self._joints = max(len(actuators) for actuators, _ in self._servos)

    def build(self, sample: int) -> ForceQuestion | None:
        """Return the question of one sample, in world axes about the object's centre of mass.

        None where a number is missing.
        """
        model, data, replay, world = self._model, self._data, self._replay, self._replay.world
        if not (np.isfinite(replay.qpos[sample]).all() and np.isfinite(replay.qvel[sample]).all()):
            return None
        data.qpos[:], data.qvel[:] = replay.qpos[sample], replay.qvel[sample]
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        fingers = np.flatnonzero(replay.contact_active[sample])
        count, joints = len(fingers), self._joints
        maps, torque_maps = np.zeros((6, 4 * count)), np.zeros((count, joints, 4))
        bias, limit = np.zeros((count, joints)), np.full((count, joints), np.inf)
        R_WO = data.xmat[world.object_body].reshape(3, 3)
        center = data.xipos[world.object_body]
        J, unloaded = np.zeros((6, model.nv)), data.qfrc_bias - data.qfrc_passive
        for i, k in enumerate(fingers.tolist()):
            p_W = data.xpos[world.object_body] + R_WO @ replay.contact_point_O[sample, k]
            R_WC = R_WO @ replay.contact_rotation_O[sample, k]
            own = maps[:, 4 * i : 4 * i + 4]
            own[:3, :3], own[3:, :3] = R_WC, np.cross(p_W - center, R_WC.T).T
            own[3:, 3] = R_WC[:, 2]
            # What presses on the object presses back on the finger: its servos hold that, and the finger.
            mujoco.mj_jac(model, data, J[:3], J[3:], p_W, int(self._tips[k]))
            actuators, dofs = self._servos[k]
            n = len(actuators)
            torque_maps[i, :n, :3], torque_maps[i, :n, 3] = J[:3, dofs].T @ R_WC, J[3:, dofs].T @ R_WC[:, 2]
            bias[i, :n], limit[i, :n] = unloaded[dofs], world.torque_limit[actuators]
        friction = replay.contact_friction[sample, fingers]
        wrench = self._compute_wrench(sample)
        question = ForceQuestion(maps, wrench, friction, self._ceiling, torque_maps, bias, limit)
        return question if question.is_finite else None

    def _compute_wrench(self, sample: int) -> Array:
        """Return what contacts should give the object (6,) [N, N m]: Newton and Euler with the reference."""
        model, data, body = self._model, self._data, self._replay.world.object_body
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        speed, acceleration = self._twist_rate[0][sample], self._twist_rate[1][sample]
        force = model.body_mass[body] * (acceleration[:3] - model.opt.gravity)
        return np.concatenate([force, inertia @ acceleration[3:] + np.cross(speed, inertia @ speed)])


def compute_acceleration(poses: Array, center: Array, step: float) -> tuple[Array, Array]:
    """Return angular velocity (T, 3) and acceleration (T, 6) in W of poses (T, 7) that are ``step`` [s] apart.

    The acceleration [m/s^2, rad/s^2] is of the point ``center`` (3,) in the moving frame and of the
    rotation, by central differences; the ends are those of their neighbours.  Fewer than three poses
    stand still.  Next to a pose that is none the result is NaN.
    """
    count = len(poses)
    speed, acceleration = np.zeros((count, 3)), np.zeros((count, 6))
    is_pose = np.isfinite(poses).all(axis=1) & (poses[:, 3:] != 0.0).any(axis=1)
    known = np.where(is_pose[:, None], poses, [np.nan, np.nan, np.nan, 1.0, 0.0, 0.0, 0.0])
    if count < 3:
        acceleration[~is_pose] = np.nan
        return speed, acceleration
    attitudes = Rotation.from_quat(known[:, 3:], scalar_first=True)
    points = known[:, :3] + attitudes.apply(center)
    between = (attitudes[1:] * attitudes[:-1].inv()).as_rotvec() / step
    speed[1:-1] = 0.5 * (between[1:] + between[:-1])
    acceleration[1:-1, :3] = np.diff(points, 2, axis=0) / step**2
    acceleration[1:-1, 3:] = np.diff(between, axis=0) / step
    acceleration[np.isnan(acceleration).any(axis=1)] = np.nan
    for values in (speed, acceleration):
        values[0], values[-1] = values[1], values[-2]
    return speed, acceleration


def _find_servos(world: World, body: int) -> tuple[Indices, Indices]:
    """Return the actuators (J,) at joints of ``body`` and of what it hangs from, and the joints' dofs (J,)."""
    model, chain = world.model, set()
    while body:
        chain.add(body)
        body = int(model.body_parentid[body])
    joints = model.actuator_trnid[:, 0]
    actuators = np.array(
        [a for a in range(model.nu) if int(model.jnt_bodyid[joints[a]]) in chain], dtype=np.intp
    )
    return actuators, model.jnt_dofadr[joints[actuators]].astype(np.intp)
