"""From a measured run to questions about forces: which contacts there were, and what they should give the object.

The object should move as a reference does, or rest: what is asked for is the inverse dynamics of that motion, with gravity,
applied forces, springs and actuators on the object itself as they were.  The measured acceleration would not do: MuJoCo's own
contact forces made it, so they always answer it, by letting the object fall if need be.

Whatever is not known to be limited counts as unlimited, so that a *no* is certain: pyramids are taken as the round cones
around them, rolling friction as a little more than it is, and a joint has a limit only where actuators are all that hold it.
"""

from __future__ import annotations

from typing import NamedTuple, final

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.errors import SceneError
from dexplan.sim.judge.force_audit_questions import compute_acceleration
from dexplan.sim.judge.force_audit_values import ForceQuestion, SharedLimits
from dexplan.spatial import Array
from dexplan.testing.actuators import find_joint_ranges
from dexplan.testing.measurement import Measurement
from dexplan.testing.parties import Indices, list_descendants
from dexplan.testing.raw_contacts import find_free_dof
from dexplan.testing.reading import INTEGRATION

CEILING = 100.0
"""Greatest normal force of a contact, in shares of what the object needs, where no other is given: a pinch whose friction is
below 1/200 needs more."""
LEVER = 0.1
"""Lever [m] that the judge's program takes a joint to have."""
CORNER = np.sqrt(2.0)
"""Corners of the square around a unit circle: rolling friction's cone is taken as the pyramid around it."""
CORNERS = CORNER * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])


class _Columns(NamedTuple):
    """Forces that may act on the object: ``maps`` (6, 4 K), ``points`` (K, 3), ``friction`` (K, 2), ``body`` (K,), where
    ``normal_moment`` (K, 3) is what a unit of normal force turns besides, standing for rolling friction.
    """

    rotation: Array
    point: Array
    friction: Array
    body: Indices
    normal_moment: Array


@final
class ForceQuestions:
    """Asks for any sample of a measured run whether the contacts that were there could make the object move as it should.

    Args:
        model: the model that was measured.
        measured: its run; an object has to be named.
        reference: poses (T, 7) [m, wxyz, W] of the object's body that should have been followed; None: it should rest.
        ceiling: greatest normal force of a contact [N]; None: a hundred times what the object needs.

    Raises: SceneError where the object is not free, or the reference does not fit.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        measured: Measurement,
        reference: Array | None = None,
        ceiling: float | None = None,
    ) -> None:
        body = measured.parties.object_body
        bodies = list_descendants(model, body) if body > 0 else []
        self.dof = find_free_dof(model, body, bodies)
        if self.dof < 0:
            raise SceneError(
                "object", "no body that moves freely is the object", "accepted: a body with a free joint"
            )
        if ceiling is not None and not (np.isfinite(ceiling) and ceiling > 0.0):
            raise SceneError("ceiling", f"{ceiling!r} is no force above 0", "accepted: newtons")
        self._model, self._measured, self._ceiling = model, measured, ceiling
        self._body, self._bodies = body, bodies
        self._data = mujoco.MjData(model)
        self._motion = _read_reference(measured, reference)
        names = measured.parties.names
        fixed_geoms = np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0)
        fixed = set(measured.parties.of_geom[fixed_geoms].tolist())
        driven = set(np.flatnonzero(measured.drives.sum(axis=0)).tolist())
        tips = set(measured.parties.tips)
        self._is_load = np.array([not (p in tips or p in fixed or p in driven) for p in range(len(names))])
        # The same numbers for every question: constraints that are not the object's contacts load joints that they touch.
        self._mark = np.random.default_rng(0).uniform(0.5, 1.0, 4096)

    def build(self, sample: int) -> ForceQuestion:
        """Return the question of one sample, in world axes about the centre of mass of the object with all that hangs on it."""
        model, data, dof = self._model, self._data, self.dof
        mujoco.mj_setState(model, data, self._measured.states[sample], INTEGRATION)
        R_WO = data.xmat[self._body].reshape(3, 3)
        data.qvel[:] = 0.0
        mujoco.mj_kinematics(model, data)
        velocity, acceleration, needed = np.zeros(6), np.zeros(model.nv), np.zeros(model.nv)
        if self._motion is not None:
            velocity, rate = self._motion[0][sample], self._motion[1][sample]
            acceleration[dof : dof + 6] = np.concatenate([rate[:3], R_WO.T @ rate[3:]])
            data.qvel[dof : dof + 6] = np.concatenate([velocity[:3], R_WO.T @ velocity[3:]])
        mujoco.mj_forward(model, data)
        mujoco.mj_mulM(model, data, needed, acceleration)
        needed -= data.qfrc_smooth
        center, origin = data.subtree_com[self._body].copy(), data.xpos[self._body]
        force = needed[dof : dof + 3].copy()
        torque = R_WO @ needed[dof + 3 : dof + 6] - np.cross(center - origin, force)
        wrench = np.concatenate([force, torque])
        columns = self._list_columns(sample)
        wrench -= self._sum_loads(sample, center)
        maps = _build_maps(columns, center)
        ceiling = self._ceiling or _choose_ceiling(wrench, maps, columns.friction)
        count = len(columns.body)
        return ForceQuestion(
            maps=maps,
            wrench=wrench,
            friction=columns.friction,
            ceiling=ceiling,
            torque_maps=np.zeros((count, 0, 4)),
            torque_bias=np.zeros((count, 0)),
            torque_limit=np.zeros((count, 0)),
            shared=self._find_limits(columns),
        )

    def _rows(self, sample: int, *, are_loads: bool) -> Indices:
        """Return the contacts of a sample that others have with the object."""
        rows, parties = self._measured.contacts, self._measured.parties
        first, last = np.searchsorted(rows.sample, [sample, sample + 1])
        here = np.arange(first, last)
        is_ours = (rows.on[here] == parties.object) & (rows.by[here] != parties.object)
        return here[is_ours & (self._is_load[rows.by[here]] == are_loads)]

    def _list_columns(self, sample: int) -> _Columns:
        """Return the forces that may be chosen."""
        rows = self._measured.contacts
        rotation, point, friction, body, moment = [], [], [], [], []
        for i in self._rows(sample, are_loads=False):
            R_WC, mu, dim = rows.rotation_W[i], rows.friction[i], int(rows.dim[i])
            sliding = float(mu[:2].max()) if dim > 1 else 0.0
            if sliding > 0.0:
                # Where friction differs with direction, a unit of the weaker one pushes less.
                R_WC = R_WC * np.append(mu[:2] / sliding, 1.0)
            corners = CORNERS * mu[3:5] if dim == 6 else np.zeros((1, 2))
            for corner in corners:
                rotation.append(R_WC)
                point.append(rows.point_W[i])
                friction.append((sliding, float(mu[2]) if dim > 3 else 0.0))
                body.append(int(self._model.geom_bodyid[rows.geom_by[i]]))
                moment.append(rows.rotation_W[i][:, :2] @ corner)
        shape = len(body)
        return _Columns(
            np.array(rotation).reshape(shape, 3, 3),
            np.array(point).reshape(shape, 3),
            np.array(friction).reshape(shape, 2),
            np.array(body, dtype=np.intp),
            np.array(moment).reshape(shape, 3),
        )

    def _sum_loads(self, sample: int, center: Array) -> Array:
        """Return the wrench (6,) of bodies that rest on the object and are held by nobody else: it was what it was."""
        rows, total = self._measured.contacts, np.zeros(6)
        for i in self._rows(sample, are_loads=True):
            force = rows.rotation_W[i] @ rows.force[i]
            total[:3] += force
            total[3:] += rows.rotation_W[i] @ rows.moment[i] + np.cross(rows.point_W[i] - center, force)
        return total

    def _find_limits(self, columns: _Columns) -> SharedLimits | None:
        """Return what the joints that actuators alone hold can take of the forces, None where nothing is known."""
        model, data = self._model, self._data
        ranges = find_joint_ranges(model, data)
        ranges[self._find_touched()] = -np.inf, np.inf
        limited = np.flatnonzero(np.isfinite(ranges).any(axis=1))
        limited = limited[(limited < self.dof) | (limited >= self.dof + 6)]
        if not len(limited) or not len(columns.body):
            return None
        maps, J = np.zeros((len(limited), 4 * len(columns.body))), np.zeros((6, model.nv))
        for k, body in enumerate(columns.body.tolist()):
            mujoco.mj_jac(model, data, J[:3], J[3:], columns.point[k], body)
            # What presses on the object presses back on the finger: its servos hold that, and the finger.
            own = maps[:, 4 * k : 4 * k + 4]
            own[:, :3] = J[:3, limited].T @ columns.rotation[k]
            own[:, 2] += J[3:, limited].T @ columns.normal_moment[k]
            own[:, 3] = J[3:, limited].T @ columns.rotation[k][:, 2]
        is_loaded = np.abs(maps).max(axis=1) > 0.0
        own_load = data.qfrc_actuator[limited] - data.qfrc_smooth[limited]
        low, high = (ranges[limited] - own_load[:, None]).T
        # Forces on slides and torques on hinges, however long their levers: OSQP gets rows of one size.
        size = np.abs(maps * _list_scales(columns.friction)).max(axis=1) / LEVER
        size = np.where(is_loaded, size, 1.0)
        maps, low, high = maps / size[:, None], low / size, high / size
        return SharedLimits(maps[is_loaded], low[is_loaded], high[is_loaded]) if is_loaded.any() else None

    def _find_touched(self) -> NDArray[np.bool_]:
        """Return which dofs (nv,) something else loads: other contacts, joint limits, equalities, friction in joints."""
        model, data = self._model, self._data
        if not data.nefc:
            return np.zeros(model.nv, dtype=bool)
        mark = np.resize(self._mark, data.nefc)
        for c in range(data.ncon):
            first, geom = int(data.contact.efc_address[c]), data.contact.geom[c]
            if first >= 0 and geom.min() >= 0 and np.isin(model.geom_bodyid[geom], self._bodies).any():
                mark[first : first + _count_rows(model, int(data.contact.dim[c]))] = 0.0
        out = np.zeros(model.nv)
        mujoco.mj_mulJacTVec(model, data, out, mark)
        return out != 0.0


def _count_rows(model: mujoco.MjModel, dim: int) -> int:
    """Return how many constraint rows a contact has."""
    is_pyramid = model.opt.cone != mujoco.mjtCone.mjCONE_ELLIPTIC and dim > 1
    return 2 * (dim - 1) if is_pyramid else dim


def _build_maps(columns: _Columns, center: Array) -> Array:
    """Return the wrenches (6, 4 K) about ``center`` of the forces (f_t1, f_t2, f_n, tau_n) of every contact."""
    maps = np.zeros((6, 4 * len(columns.body)))
    for k, R_WC in enumerate(columns.rotation):
        own = maps[:, 4 * k : 4 * k + 4]
        own[:3, :3], own[3:, :3] = R_WC, np.cross(columns.point[k] - center, R_WC.T).T
        own[3:, 2] += columns.normal_moment[k]
        own[3:, 3] = R_WC[:, 2]
    return maps


def _list_scales(friction: Array) -> Array:
    """Return what each force (4 K,) can be at most per newton of normal force: mu, mu, 1, mu_t."""
    mu, torsional = friction.T
    return np.stack([mu, mu, np.ones_like(mu), torsional], axis=1).ravel()


def _choose_ceiling(wrench: Array, maps: Array, friction: Array) -> float:
    """Return a normal force [N] far beyond what the object needs; 1 where it needs nothing."""
    # What a newton of normal force can turn, friction included [m].
    arm = np.linalg.norm(maps[3:] * _list_scales(friction), axis=0).max(initial=0.0)
    turning = float(np.linalg.norm(wrench[3:])) / arm if arm > 0.0 else 0.0
    return CEILING * max(float(np.linalg.norm(wrench[:3])), turning) or 1.0


def _read_reference(measured: Measurement, reference: Array | None) -> tuple[Array, Array] | None:
    """Return velocity and acceleration (T, 6) of a reference's body frame, in W; None: it should rest."""
    if reference is None:
        return None
    poses = np.asarray(reference, dtype=np.float64)
    if poses.shape != (len(measured.time), 7) or not np.isfinite(poses).all():
        raise SceneError(
            "reference",
            f"has shape {poses.shape}",
            f"accepted: ({len(measured.time)}, 7), finite poses (m, wxyz)",
        )
    if len(poses) < 3:
        return None
    steps = np.diff(measured.time)
    turning, acceleration = compute_acceleration(poses, np.zeros(3), float(steps.mean()))
    return np.hstack([np.gradient(poses[:, :3], measured.time, axis=0), turning]), acceleration
