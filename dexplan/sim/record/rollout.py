"""Steps the world under the controller and records what happened."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import mujoco
import numpy as np
from mujoco.batch import Batch

from dexplan.brief import brief_repr
from dexplan.contact.bodies.smooth import BallBody
from dexplan.control.controller import Command, Controller
from dexplan.control.foreign import ForeignCommand, ForeignController, ForeignDriver
from dexplan.control.observation import Observation
from dexplan.control.options import ControlOptions
from dexplan.control.reference import Reference
from dexplan.errors import ControllerError
from dexplan.kinematics.chain import solve_ik
from dexplan.scene.scene import Scene
from dexplan.scene.touch import build_touch_model, compute_static_normal_force
from dexplan.sim.machine import describe_machine, describe_versions
from dexplan.sim.record.recorder import BATCH, STATE, Recorder
from dexplan.sim.trace import Trace
from dexplan.spatial import Array

START_DEPTH = 5e-5
"""How deep the tips stand in the object at the start [m]: about what their first newtons make of a touch."""
PACKAGES = ("dexplan", "mujoco", "mink", "daqp", "osqp", "numpy", "scipy")
"""Whose versions a record names."""


@dataclass(frozen=True, eq=False)
class Truth:
    """What is true where it differs from what is believed.

    ``scene`` has the true friction, mass and sizes; ``X_WO_start`` (4, 4) is the object's pose at the start.  None: as believed.
    """

    scene: Scene | None = None
    X_WO_start: Array | None = None

    __repr__ = brief_repr


def rollout(
    scene: Scene,
    reference: Reference,
    options: ControlOptions,
    *,
    controller: ForeignController | None = None,
    truth: Truth | None = None,
    meta: Mapping[str, Any] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trace:
    """Run ``reference`` on ``scene`` and return the trace; a run that fails returns the trace so far.

    ``scene`` is what the controller believes, ``truth`` what is so.  ``controller`` takes the place of dexplan's own, from the
    same start, at the same rate, with the same columns but for those that only dexplan's own has anything to write into; the
    trace's ``meta["controller"]`` names it.  ``progress`` is called with the share done.

    A failure (object lost, finger that finds nothing) stands in the trace's ``meta["failure"]``.  An exception that cuts
    the run short, Ctrl-C included, goes on with the trace so far as its attribute ``trace``; ControllerError is raised for what a
    foreign controller does wrong.
    """
    truth = truth or Truth()
    believed, scene = scene, truth.scene or scene
    model = scene.model
    steps = _count_steps(model, options.tick)
    data = mujoco.MjData(model)
    X_WO = scene.object.X_WO_home if truth.X_WO_start is None else truth.X_WO_start
    own = Controller(believed, reference, options)
    driver = own if controller is None else ForeignDriver(controller, believed, reference, options)
    named = {} if isinstance(driver, Controller) else {"controller": driver.name}
    _set_start(scene, believed, reference, own, X_WO, data)
    planned = max(reference.duration, options.tick)
    return _drive(scene, driver, data, steps, planned, {**(meta or {}), **named}, progress)


class Driver(Protocol):
    """What is asked once per tick: dexplan's controller for hands of six joints, another one of ours, or somebody else's."""

    def step(self, observation: Observation) -> Command | ForeignCommand:
        """Return the command for the tick that starts now."""
        ...


def rollout_driver(
    scene: Scene, driver: Driver, q: Array, X_WO: Array, tick: float, duration: float
) -> Trace:
    """Run a driver that knows its own plan and return the trace, as :func:`rollout` does.

    The world starts at rest with the fingers at ``q`` (F, J) [rad] and the object at ``X_WO`` (4, 4); the run ends when the
    driver is done, and at the latest after three times the planned ``duration`` [s].
    """
    data = mujoco.MjData(scene.model)
    data.qpos[:] = scene.as_qpos(q, X_WO)
    mujoco.mj_forward(scene.model, data)
    return _drive(scene, driver, data, _count_steps(scene.model, tick), duration, {})


def _count_steps(model: mujoco.MjModel, tick: float) -> int:
    """Return how many steps of physics a control period [s] lasts; raises ValueError where that is no whole number."""
    steps = round(tick / model.opt.timestep)
    if steps < 1 or abs(steps * model.opt.timestep - tick) > 1e-9:
        raise ValueError(
            f"{1.0 / tick:g} ticks per second do not last a whole number of physics steps of {model.opt.timestep:g} s"
        )
    return steps


def _drive(
    scene: Scene,
    driver: Driver,
    data: mujoco.MjData,
    steps: int,
    planned: float,
    meta: Mapping[str, Any],
    progress: Callable[[float], None] | None = None,
) -> Trace:
    """Step the world in ``data`` under a driver, ``steps`` steps per tick, until it is done or the object is lost."""
    model, senses = scene.model, _Senses(scene, data)
    initial_state = np.zeros(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, initial_state, STATE)
    # On this thread alone: whoever wants more cores runs more runs.
    has_internals = isinstance(driver, Controller)
    recorder = Recorder(scene, Batch(build_touch_model(scene), BATCH, 1), has_internals=has_internals)
    failure: str | None = None

    def as_trace(failure: str | None) -> Trace:
        columns = recorder.as_columns()
        columns["initial_state"] = initial_state
        columns["physics_steps_per_sample"] = np.array(steps)
        made_by = {"versions": describe_versions(*PACKAGES), "machine": describe_machine()}
        return Trace(scene.xml, columns, {**meta, "failure": failure, **made_by})

    try:
        for _ in range(int(3.0 * planned / (steps * model.opt.timestep)) + 500):
            command = driver.step(senses.observe())
            data.ctrl[:] = command.ctrl
            recorder.keep(data, command)
            failure = command.failure or _find_failure(scene, data, command.X_WO_ref)
            if command.is_done or failure:
                break
            mujoco.mj_step(model, data, nstep=steps)
            if progress is not None:
                progress(min(1.0, data.time / planned))
    except BaseException as error:
        if recorder.count:
            what = "interrupted" if isinstance(error, KeyboardInterrupt) else type(error).__name__
            what = str(error) if isinstance(error, ControllerError) else what
            error.trace = as_trace(f"cut short: {what}")  # type: ignore[attr-defined]
        raise
    return as_trace(failure)


FALLEN = 0.05
"""An object so far under its reference [m] was dropped."""


def _set_start(
    scene: Scene,
    believed: Scene,
    reference: Reference,
    controller: Controller,
    X_WO: Array,
    data: mujoco.MjData,
) -> None:
    """Put the tips in contact where the reference starts, as deep as the first wanted forces press them; others at home.

    The world starts at rest; a tip that starts too shallow would fall into the object and drag it along.  Contacts are stated by
    direction: where the true object or tips have another size than the ``believed`` ones, the tips touch the true object.
    ``controller`` is asked for its first command, again and again, and left as new.
    """
    touching = [i for i, start in enumerate(reference.start) if start is not None]
    depth = np.full(scene.n_fingers, START_DEPTH)
    senses = _Senses(scene, data)
    for _ in range(4):
        data.qpos[:] = scene.as_qpos(_start_posture(scene, believed, reference, X_WO, depth), X_WO)
        mujoco.mj_forward(scene.model, data)
        wanted = controller.step(senses.observe()).forces_W
        controller.restart()
        surface_normals = {i: _inward_normal(scene, data, i) for i in touching}
        for i in touching:
            static = compute_static_normal_force(scene, data, i)
            if static > 0.0 and np.isfinite(wanted[i]).all():
                depth[i] *= float(surface_normals[i] @ wanted[i, :3]) / static
    data.qpos[:] = scene.as_qpos(_start_posture(scene, believed, reference, X_WO, depth), X_WO)
    mujoco.mj_forward(scene.model, data)


def _inward_normal(scene: Scene, data: mujoco.MjData, finger: int) -> Array:
    """Return the inward normal (3,) at the finger's contact in W: from the tip's centre to the object's nearest point."""
    offset = data.xpos[scene.object_body] - data.geom_xpos[scene.tip_geoms[finger]]
    if isinstance(scene.object.body, BallBody):
        return offset / np.linalg.norm(offset)
    R_WO = data.xmat[scene.object_body].reshape(3, 3)
    return -R_WO @ scene.object.body.project(-offset @ R_WO).normal


def _start_posture(scene: Scene, believed: Scene, reference: Reference, X_WO: Array, depth: Array) -> Array:
    """Return joint angles (F, J) with the tips ``depth`` (F,) [m] in the object where the reference starts, others at home."""
    posture = []
    rows = zip(scene.fingers, believed.fingers, reference.start, depth, strict=True)
    for finger, imagined, start, d in rows:
        q = finger.q_home
        if start is not None:
            X = start[0].copy()
            X[:3, 3] = _touch(scene, believed, X[:3, 3], finger.tip_radius, imagined.tip_radius, d)
            solved, _ = solve_ik(finger.chain, (X_WO @ X)[None], start[1][None])
            q = solved[0]
        posture.append(q)
    return np.stack(posture)


def _touch(
    scene: Scene, believed: Scene, p_OF: Array, tip_radius: float, imagined_radius: float, depth: float
) -> Array:
    """Return where a tip's centre (3,) is in O if it is to touch the true object ``depth`` [m] deep.

    ``p_OF`` (3,) is where it would touch the ``believed`` one with the radius that is imagined.
    """
    body = scene.object.body
    if isinstance(body, BallBody):
        away = scene.object.surface.radial(p_OF) - believed.object.surface.radial(p_OF)
        outward = p_OF / np.linalg.norm(p_OF)
        farther = float(outward @ away) + tip_radius - imagined_radius
        return np.asarray(p_OF * (1.0 - (depth - farther) / np.linalg.norm(p_OF)))
    outward, p = believed.object.body.project(p_OF).normal, p_OF
    for _ in range(3):
        p = p + (tip_radius - depth - float(body.project(p).distance)) * outward
    return p


class _Senses:
    """Reads from the simulator what a robot's senses would tell."""

    def __init__(self, scene: Scene, data: mujoco.MjData) -> None:
        self._scene, self._data = scene, data
        # The free joint's qpos, not xpos: derived quantities of the last sub-step are one step old.
        address = scene.object_qpos
        self._qpos, self._qvel, self._contacts = data.qpos, data.qvel, data.contact
        self._p_WO, self._quat = data.qpos[address : address + 3], data.qpos[address + 3 : address + 7]
        self._flat, self._eye = np.empty(9), np.eye(4)
        self._R_WO = self._flat.reshape(3, 3)
        self._tips = scene.tip_geoms.tolist()

    def observe(self) -> Observation:
        """Return what is sensed now."""
        scene, data, ball = self._scene, self._data, self._scene.object_geom
        X_WO = self._eye.copy()
        mujoco.mju_quat2Mat(self._flat, self._quat)
        X_WO[:3, :3], X_WO[:3, 3] = self._R_WO, self._p_WO
        touched: set[int] = set()
        if data.ncon:
            for (a, b), distance in zip(
                self._contacts.geom.tolist(), self._contacts.dist.tolist(), strict=True
            ):
                if distance < 0.0 and (a == ball or b == ball):
                    touched.add(b if a == ball else a)
        touching = np.array([tip in touched for tip in self._tips])
        q, qdot = self._qpos[scene.joint_qpos], self._qvel[scene.joint_dof]
        return Observation(data.time, q, qdot, X_WO, touching)


def _find_failure(scene: Scene, data: mujoco.MjData, X_WO_ref: Array) -> str | None:
    if not math.isfinite(data.qpos.sum()):
        return "the simulation diverged"
    if data.qpos[scene.object_qpos + 2] < X_WO_ref[2, 3] - FALLEN:
        return "the object was dropped"
    return None
