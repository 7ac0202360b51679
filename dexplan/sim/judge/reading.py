"""What is read off a replayed run: contacts, forces, slip and clearances of many samples at once.

The states of many samples go through one call to MuJoCo (warm start and control included), which computes for each exactly the
first half of the step that follows.  Contact sensors, one per fingertip, answer for tip and object; a sample in which anything
else touches, or a tip touches twice, is read contact by contact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np
from mujoco.batch import Batch

from dexplan.brief import brief_repr
from dexplan.sim.judge.clearances import OBSTACLE_KINDS, Clearances
from dexplan.sim.judge.world import Flags, Indices, World
from dexplan.spatial import Array

INTEGRATION = mujoco.mjtState.mjSTATE_INTEGRATION
SAMPLES = 256
"""Samples that go through MuJoCo together."""
_FIELDS = (
    "sensordata",
    "ncon",
    "actuator_force",
    "site_xpos",
    "site_xmat",
    "xpos",
    "xmat",
    "cvel",
    "subtree_com",
)
_WIDTH = 17
"""Numbers of one contact sensor: found, force (3), torque (3), distance, position (3), normal (3), tangent (3)."""


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


@lru_cache(maxsize=1)
def build_sensed_model(model_xml: str, fingers: tuple[str, ...]) -> mujoco.MjModel:
    """Return the model with a contact sensor of tip and object per finger, after all sensors that it has."""
    spec = mujoco.MjSpec.from_string(model_xml)
    for name in fingers:
        sensor = spec.add_sensor(
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=f"{name}/tip",
            reftype=mujoco.mjtObj.mjOBJ_GEOM,
            refname="object/surface",
        )
        # All of what a contact sensor can give, of the deepest contact.
        sensor.intprm[:3] = [127, 1, 1]
    return spec.compile()


class Reader:
    """Collects the samples of one replay."""

    def __init__(self, world: World, batch: Batch, samples: int, stride: int, horizon: float) -> None:
        """``batch`` has :data:`SAMPLES` simulations of the model with sensors."""
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
        self._clearances = Clearances(world, horizon)
        self._velocity = np.zeros((2, 6))
        self._wrench = np.zeros(6)
        self._batch, self._mirror = batch, mujoco.MjData(model)
        self._fields = {name: batch.bind(name) for name in _FIELDS}
        self._states = {name: batch.bind(name) for name in ("time", "qpos", "qvel")}
        # What MuJoCo makes of a pair of geoms is the same in every sample: sliding and torsional friction (F, 2).
        self._known = np.full((F, 2), np.nan)

    def read(self, first: int, count: int) -> None:
        """Read the samples from ``first`` on, whose states are the first ``count`` rows of the batch."""
        world, rows = self.world, slice(first, first + count)
        self.time[rows] = self._states["time"][:count]
        self.qpos[rows], self.qvel[rows] = self._states["qpos"][:count], self._states["qvel"][:count]
        states = self._batch.state[:count].copy()
        self._batch.forward(np.arange(count))
        fields = {name: field[:count] for name, field in self._fields.items()}
        self.tip_position[rows] = fields["site_xpos"][:, world.tip_sites]
        self.tip_rotation[rows] = fields["site_xmat"][:, world.tip_sites].reshape(count, -1, 3, 3)
        self.actuator_force[rows] = fields["actuator_force"]
        found = fields["sensordata"][:, -_WIDTH * len(world.fingers) :].reshape(count, -1, _WIDTH)[..., 0]
        self._read_touches(rows, fields)
        # Whatever is not one contact of each tip that touches, and every tip's first contact, is looked at closely.
        unusual = (fields["ncon"].reshape(count) != (found == 1.0).sum(axis=1)) | (found > 1.0).any(axis=1)
        for finger in np.flatnonzero(np.isnan(self._known[:, 0]) & (found > 0.0).any(axis=0)):
            unusual[np.argmax(found[:, finger] > 0.0)] = True
        for k in np.flatnonzero(unusual).tolist():
            mujoco.mj_setState(world.model, self._mirror, states[k], INTEGRATION)
            mujoco.mj_forward(world.model, self._mirror)
            self._read_contacts(first + k, self._mirror)
        touching = np.isnan(self.friction[rows, :, 0]) & self.active[rows]
        self.friction[rows][touching] = np.broadcast_to(self._known, (count, *self._known.shape))[touching]
        for t in range(first + -first % self.stride, first + count, self.stride):
            self.clearance_samples.append(t)
            self.clearance.append(self._clearances.measure(self.qpos[t]))

    def _read_touches(self, rows: slice, fields: Mapping[str, Array]) -> None:
        """Take over what the contact sensors say: normal from tip to object, force on the object along normal, t1, t2."""
        world, roots = self.world, self.world.model.body_rootid
        sensed = fields["sensordata"][:, -_WIDTH * len(world.fingers) :]
        sensed = sensed.reshape(len(sensed), -1, _WIDTH)
        active = sensed[..., 0] > 0.0
        sensed = np.where(active[..., None], sensed, np.nan)
        p_W, n, t1 = sensed[..., 8:11], sensed[..., 11:14], sensed[..., 14:17]
        R_WC = np.stack([t1, np.cross(n, t1), n], axis=-1)
        R_OW = fields["xmat"][:, world.object_body].reshape(-1, 1, 3, 3).swapaxes(-1, -2)
        self.active[rows] = active
        self.point[rows] = (R_OW @ (p_W - fields["xpos"][:, None, world.object_body])[..., None])[..., 0]
        self.rotation[rows] = R_OW @ R_WC
        self.force[rows] = sensed[..., [2, 3, 1, 4]]
        self.penetration[rows] = -sensed[..., 7]
        tips = world.model.geom_bodyid[world.tip_geoms]

        def move(bodies: Indices) -> tuple[Array, Array]:
            # cvel: (w, v) of the point of the body that is at the centre of mass of its tree.
            w, v = fields["cvel"][:, bodies, :3], fields["cvel"][:, bodies, 3:]
            return v + np.cross(w, p_W - fields["subtree_com"][:, roots[bodies]]), w

        (v, w), (v_ball, w_ball) = move(tips), move(np.full_like(tips, world.object_body))
        self.slip[rows, :, :2] = (R_WC.swapaxes(-1, -2) @ (v - v_ball)[..., None])[..., :2, 0]
        self.slip[rows, :, 2] = ((w - w_ball) * n).sum(axis=-1)
        towards = p_W - self.tip_position[rows]
        cosine = (towards * self.tip_rotation[rows, ..., 2]).sum(axis=-1) / np.linalg.norm(towards, axis=-1)
        self.angle[rows] = np.arccos(np.clip(cosine, -1.0, 1.0))

    def _read_contacts(self, t: int, data: mujoco.MjData) -> None:
        """Sort the contacts that take part in the dynamics into tip-object ones and others."""
        world, model, contact = self.world, self.world.model, data.contact
        self.active[t], self.penetration[t] = False, np.nan
        for column in (self.point, self.rotation, self.force, self.slip, self.angle):
            column[t] = np.nan
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
            self.friction[t, k] = self._known[k] = mu, torsional if contact.dim[c] >= 4 else 0.0
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
        # The body's frame: MuJoCo keeps a mesh in axes of its own.
        R_WO = data.xmat[world.object_body].reshape(3, 3)
        p_WO = data.xpos[world.object_body]
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


def _cross(a: Array, b: Array) -> Array:
    """Return a x b for single vectors; np.cross takes ten times as long."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
