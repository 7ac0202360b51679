"""Step a recorded world again and read off what happened, knowing nothing of planner or controller.

Together with the rollout this is the only place that steps MuJoCo.  Stepping is the recipe of the record and
nothing else: ``mj_setState(initial_state)``, then per sample ``ctrl`` and ``mj_step(nstep)``.  Everything is
read from a second MjData that receives a copy of the state (warm start included) and a ``mj_forward``: that
is exactly the first half of the step that follows, so contacts belong to the sample's own state and control,
and no reading can disturb the stepping.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from dexplan.brief import brief_repr
from dexplan.errors import RunFolderError
from dexplan.sim.judge.world import Flags, Indices, World, read_world
from dexplan.spatial import Array

INTEGRATION = mujoco.mjtState.mjSTATE_INTEGRATION
OBSTACLE_KINDS = ("object", "fingers", "obstacles", "floor")
"""What a finger's clearance is measured to: the last axis of ``Replay.clearance``."""


@dataclass(frozen=True)
class OtherContact:
    """A contact that is not fingertip on object: sample, geom names, force [N] (its norm), distance [m]."""

    sample: int
    geoms: tuple[str, str]
    force: float
    distance: float


@dataclass(frozen=True, eq=False)
class Replay:
    """What happened at T samples, F fingers.  Sample t is the state before the steps that ``ctrl[t]`` drives.

    ``object_pose`` (T, 7) [m, wxyz, W]; ``tip_position`` (T, F, 3), ``tip_rotation`` (T, F, 3, 3) in W, z
    towards the tip's pole. Contacts of tip on object, NaN where there is none: ``contact_active`` (T, F);
    ``contact_point_O`` (T, F, 3); ``contact_rotation_O`` (T, F, 3, 3) with columns t1, t2, n, n into the
    object; ``contact_friction`` (T, F, 2) = sliding [-] and torsional [m], the latter 0 where a contact has none;
    ``contact_force`` (T, F, 4) = (f_t1, f_t2, f_n, tau_n) on the object; ``contact_slip_velocity``
    (T, F, 3) = two tangential [m/s] and spin [rad/s] of the tip against the object; ``penetration`` (T, F)
    [m]; ``tip_contact_angle`` (T, F) [rad].  ``actuator_force`` (T, nu) [N m]. ``clearance`` (K, F, 4) [m] at
    ``clearance_samples`` (K,), per finger to :data:`OBSTACLE_KINDS`, at most ``clearance_horizon``.
    ``contact_settings`` are the distinct (friction, solref, solimp, condim) rows met on the object;
    ``warnings`` counts MuJoCo's own warnings by name.
    """

    world: World
    time: Array
    qpos: Array
    qvel: Array
    object_pose: Array
    tip_position: Array
    tip_rotation: Array
    contact_active: Flags
    contact_point_O: Array
    contact_rotation_O: Array
    contact_friction: Array
    contact_force: Array
    contact_slip_velocity: Array
    penetration: Array
    tip_contact_angle: Array
    actuator_force: Array
    other_contacts: tuple[OtherContact, ...]
    clearance_samples: Indices
    clearance: Array
    clearance_horizon: float
    contact_settings: tuple[tuple[float, ...], ...]
    warnings: Mapping[str, int]

    __repr__ = brief_repr


def replay(
    model_xml: str,
    initial_state: Array,
    ctrl: Array,
    physics_steps_per_sample: int,
    xfrc_applied: Array | None = None,
    *,
    clearance_stride: int = 5,
    clearance_horizon: float = 0.02,
) -> Replay:
    """Step ``model_xml`` from ``initial_state`` (mjSTATE_INTEGRATION) under ``ctrl`` (T, nu) and read every
    sample.

    ``xfrc_applied`` (T, nbody, 6) is a declared disturbance [N, N m, W].  Clearances are read at every
    ``clearance_stride``-th sample, out to ``clearance_horizon`` [m].  Raises RunFolderError where shapes do
    not fit the model.
    """
    world = read_world(model_xml)
    model = world.model
    ctrl = np.asarray(ctrl, dtype=np.float64)
    state = np.asarray(initial_state, dtype=np.float64)
    size = mujoco.mj_stateSize(model, INTEGRATION)
    _require_shape("ctrl", ctrl, (len(ctrl) if ctrl.ndim else 0, model.nu))
    _require_shape("initial_state", state, (size,))
    if xfrc_applied is not None:
        _require_shape("xfrc_applied", np.asarray(xfrc_applied), (len(ctrl), model.nbody, 6))
    if physics_steps_per_sample < 1:
        raise RunFolderError(
            "trace.npz", f"physics_steps_per_sample is {physics_steps_per_sample}", "1 or more is needed"
        )
    data, mirror = mujoco.MjData(model), mujoco.MjData(model)
    mujoco.mj_setState(model, data, state, INTEGRATION)
    reader = _Reader(world, len(ctrl), clearance_stride, clearance_horizon)
    buffer = np.empty(size)
    for t in range(len(ctrl)):
        data.ctrl[:] = ctrl[t]
        if xfrc_applied is not None:
            data.xfrc_applied[:] = xfrc_applied[t]
        mujoco.mj_getState(model, data, buffer, INTEGRATION)
        mujoco.mj_setState(model, mirror, buffer, INTEGRATION)
        mujoco.mj_forward(model, mirror)
        reader.read(t, mirror)
        if t + 1 < len(ctrl):
            mujoco.mj_step(model, data, nstep=physics_steps_per_sample)
    return reader.as_replay(data)


class _Reader:
    """Collects the samples of one replay."""

    def __init__(self, world: World, samples: int, stride: int, horizon: float) -> None:
        model, T, F = world.model, samples, len(world.fingers)
        self.world, self.stride, self.horizon = world, stride, horizon
        self.time, self.qpos, self.qvel = np.zeros(T), np.zeros((T, model.nq)), np.zeros((T, model.nv))
        self.tip_position, self.tip_rotation = np.zeros((T, F, 3)), np.zeros((T, F, 3, 3))
        self.active = np.zeros((T, F), dtype=bool)
        self.point, self.rotation = np.full((T, F, 3), np.nan), np.full((T, F, 3, 3), np.nan)
        self.friction = np.full((T, F, 2), np.nan)
        self.force, self.slip = np.full((T, F, 4), np.nan), np.full((T, F, 3), np.nan)
        self.penetration, self.angle = np.full((T, F), np.nan), np.full((T, F), np.nan)
        self.actuator_force = np.zeros((T, model.nu))
        self.others: list[OtherContact] = []
        self.settings: dict[bytes, tuple[float, ...]] = {}
        self.clearance_samples: list[int] = []
        self.clearance: list[Array] = []
        self.finger_of_tip = {int(g): k for k, g in enumerate(world.tip_geoms)}
        # The same world with every geom reaching out by the horizon: its collisions are distances.
        self.wide = copy.deepcopy(model)
        self.wide.geom_margin[:] = horizon
        self.wide.body_margin[:] = horizon  # made from the geoms' when the model was compiled
        self.wide_data = mujoco.MjData(self.wide)
        self.kind_of_geom = _name_kinds(world)
        self._velocity = np.zeros((2, 6))
        self._wrench = np.zeros(6)

    def read(self, t: int, data: mujoco.MjData) -> None:
        """Read sample ``t`` from ``data``, which is up to date with its state and control."""
        world = self.world
        self.time[t], self.qpos[t], self.qvel[t] = data.time, data.qpos, data.qvel
        self.tip_position[t] = data.site_xpos[world.tip_sites]
        self.tip_rotation[t] = data.site_xmat[world.tip_sites].reshape(-1, 3, 3)
        self.actuator_force[t] = data.actuator_force
        if data.ncon:
            self._read_contacts(t, data)
        if t % self.stride == 0:
            self.clearance_samples.append(t)
            self.clearance.append(self._read_clearance(data.qpos))

    def _read_contacts(self, t: int, data: mujoco.MjData) -> None:
        """Sort the contacts that take part in the dynamics into tip-object ones and others."""
        world, model, contact = self.world, self.world.model, data.contact
        geoms, distances, addresses = contact.geom.copy(), contact.dist.copy(), contact.efc_address.copy()
        for c in np.flatnonzero(addresses >= 0):
            first, second = int(geoms[c, 0]), int(geoms[c, 1])
            mujoco.mj_contactForce(model, data, int(c), self._wrench)
            tip = first if second == world.object_geom else second
            k = self.finger_of_tip.get(tip)
            if k is None or world.object_geom not in (first, second):
                pair = (world.geom_names[first], world.geom_names[second])
                force = float(np.linalg.norm(self._wrench[:3]))
                self.others.append(OtherContact(t, pair, force, float(distances[c])))
                continue
            # Of several contacts of one tip the deepest stands for all; sphere on sphere has one.
            if self.active[t, k] and -distances[c] <= self.penetration[t, k]:
                continue
            self._read_touch(t, k, int(c), data, float(distances[c]), second == world.object_geom)
            mu, _, torsional = contact.friction[c, :3]
            self.friction[t, k] = mu, torsional if contact.dim[c] >= 4 else 0.0
            row = np.concatenate(
                [contact.friction[c], contact.solref[c], contact.solimp[c], [float(contact.dim[c])]]
            )
            self.settings.setdefault(row.tobytes(), tuple(float(x) for x in row))

    def _read_touch(
        self, t: int, k: int, c: int, data: mujoco.MjData, distance: float, is_second: bool
    ) -> None:
        """Read contact ``c`` of finger ``k``; ``is_second``: the object is the geom MuJoCo's normal points
        to.
        """
        world = self.world
        # MuJoCo: rows normal, t1, t2; normal from first to second geom; the wrench is normal-first and acts
        # on the second.
        rows = data.contact.frame[c].reshape(3, 3)
        w = self._wrench
        if is_second:
            R_WC = np.stack([rows[1], rows[2], rows[0]], axis=1)
            force = (w[1], w[2], w[0], w[3])
        else:
            # n and t2 flip, which keeps the frame right-handed; the force on the first geom is the opposite
            # one.
            R_WC = np.stack([rows[1], -rows[2], -rows[0]], axis=1)
            force = (-w[1], w[2], w[0], w[3])
        p_W = data.contact.pos[c].copy()
        R_WO = data.geom_xmat[world.object_geom].reshape(3, 3)
        p_WO = data.geom_xpos[world.object_geom]
        self.active[t, k] = True
        self.point[t, k] = R_WO.T @ (p_W - p_WO)
        self.rotation[t, k] = R_WO.T @ R_WC
        self.force[t, k] = force
        self.penetration[t, k] = -distance
        tip = int(world.tip_geoms[k])
        for row, geom in enumerate((tip, world.object_geom)):
            velocity = self._velocity[row]
            mujoco.mj_objectVelocity(world.model, data, mujoco.mjtObj.mjOBJ_GEOM, geom, velocity, 0)
            velocity[3:] += _cross(velocity[:3], p_W - data.geom_xpos[geom])
        relative = self._velocity[0] - self._velocity[1]
        tangential = R_WC.T @ relative[3:]
        self.slip[t, k] = tangential[0], tangential[1], R_WC[:, 2] @ relative[:3]
        towards = p_W - self.tip_position[t, k]
        cosine = towards @ self.tip_rotation[t, k, :, 2] / np.linalg.norm(towards)
        self.angle[t, k] = np.arccos(np.clip(cosine, -1.0, 1.0))

    def _read_clearance(self, qpos: Array) -> Array:
        """Return the smallest distances (F, 4) [m] of each finger's geoms to :data:`OBSTACLE_KINDS`, at most
        the horizon.
        """
        out = np.full((len(self.world.fingers), len(OBSTACLE_KINDS)), self.horizon)
        self.wide_data.qpos[:] = qpos
        mujoco.mj_kinematics(self.wide, self.wide_data)
        mujoco.mj_collision(self.wide, self.wide_data)
        if not self.wide_data.ncon:
            return out
        pairs, distances = self.wide_data.contact.geom, self.wide_data.contact.dist
        owner, kind = self.world.geom_finger, self.kind_of_geom
        for one, other in ((pairs[:, 0], pairs[:, 1]), (pairs[:, 1], pairs[:, 0])):
            # A finger's own links are no obstacle to it.
            counts = (owner[one] >= 0) & (owner[one] != owner[other])
            np.minimum.at(out, (owner[one[counts]], kind[other[counts]]), distances[counts])
        return out

    def as_replay(self, data: mujoco.MjData) -> Replay:
        """Return all samples, frozen; ``data`` supplies MuJoCo's warnings."""
        world = self.world
        warnings = {
            mujoco.mjtWarning(i).name.removeprefix("mjWARN_").lower(): int(data.warning[i].number)
            for i in range(mujoco.mjtWarning.mjNWARNING.value)
        }
        shape = (-1, len(world.fingers), len(OBSTACLE_KINDS))
        result = Replay(
            world=world,
            time=self.time,
            qpos=self.qpos,
            qvel=self.qvel,
            object_pose=self.qpos[:, world.object_qpos : world.object_qpos + 7].copy(),
            tip_position=self.tip_position,
            tip_rotation=self.tip_rotation,
            contact_active=self.active,
            contact_point_O=self.point,
            contact_rotation_O=self.rotation,
            contact_friction=self.friction,
            contact_force=self.force,
            contact_slip_velocity=self.slip,
            penetration=self.penetration,
            tip_contact_angle=self.angle,
            actuator_force=self.actuator_force,
            other_contacts=tuple(self.others),
            clearance_samples=np.array(self.clearance_samples, dtype=np.intp),
            clearance=np.array(self.clearance, dtype=np.float64).reshape(shape),
            clearance_horizon=self.horizon,
            contact_settings=tuple(self.settings.values()),
            warnings={name: count for name, count in warnings.items() if count},
        )
        for value in vars(result).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        return result


def _name_kinds(world: World) -> Indices:
    """Return for each geom its index in :data:`OBSTACLE_KINDS`; whatever is neither object, finger nor floor
    is an obstacle.
    """
    kinds = np.full(len(world.geom_names), OBSTACLE_KINDS.index("obstacles"))
    kinds[world.geom_finger >= 0] = OBSTACLE_KINDS.index("fingers")
    kinds[world.object_geom] = OBSTACLE_KINDS.index("object")
    kinds[world.geom_names.index("floor")] = OBSTACLE_KINDS.index("floor")
    return kinds


def _require_shape(name: str, array: Array, shape: tuple[int, ...]) -> None:
    """Raise RunFolderError where a column does not fit the model."""
    if array.shape != shape:
        raise RunFolderError("trace.npz", f"{name} has shape {array.shape}", f"the model needs {shape}")


def _cross(a: Array, b: Array) -> Array:
    """Return a x b for single vectors; np.cross takes ten times as long."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
