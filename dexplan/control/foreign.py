"""Other people's controllers: what they are told, what they answer, and what an answer may not be.

A controller is a function ``step(observation) -> ctrl``, or an object with such a method and, where it wants one, a method
``reset(start)``.  ``reset`` is called once before the first tick, ``step`` once per tick, in order.  ``ctrl`` (nu,) are the
targets of the position servos [rad], in the order of ``observation.q.ravel()``; they are held until the next tick.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dexplan.brief import brief_repr
from dexplan.control.clock import PlanClock, PlanTime
from dexplan.control.observation import Observation, PlannedMotion
from dexplan.control.options import ControlOptions
from dexplan.control.reference import Reference
from dexplan.errors import ControllerError
from dexplan.scene.scene import Scene
from dexplan.spatial import Array, lock_arrays

NEEDED = "a function step(observation) -> ctrl, or an object with a method of that name, is accepted"
SHOWN = 120
"""So many characters are shown of a wrong answer, and of what an error says."""


@dataclass(frozen=True, eq=False)
class RunStart:
    """What a controller is told before the first tick.

    ``model_xml`` is the MJCF text of the world as it is believed to be, for whoever computes with a model; the true one may
    have another friction, mass or size.  ``tick`` [s] is the control period, ``duration`` [s] how long the plan takes.
    ``fingers`` (F,) and ``joints`` (F * J,) are names in the order of ``observation.q`` and ``observation.q.ravel()``,
    ``servos`` (nu,) those of the actuators in the order of ``ctrl``, which is the same.  Targets from ``lowest`` to
    ``highest`` (nu,) [rad] are accepted.  ``observation`` is the first one: time 0, everything at rest, the tips on the object
    where the plan has them, and as deep in it as the first planned forces press them.
    """

    model_xml: str
    tick: float
    duration: float
    fingers: tuple[str, ...]
    joints: tuple[str, ...]
    servos: tuple[str, ...]
    lowest: Array
    highest: Array
    observation: Observation

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


class SteppingController(Protocol):
    """A controller with a state: told of each run before it begins, then asked once per tick."""

    def reset(self, start: RunStart) -> None:
        """Be ready for a new run."""

    def step(self, observation: Observation) -> ArrayLike:
        """Return the servos' targets (nu,) [rad] until the next tick."""


ForeignController = Callable[[Observation], ArrayLike] | SteppingController
"""What :func:`dexplan.rollout` accepts as ``controller``."""


@dataclass(frozen=True, eq=False)
class ForeignCommand:
    """What one tick of somebody else's controller decided: ``ctrl`` (nu,), beside where the plan is.

    ``X_WO_ref`` (4, 4) is the plan's pose of the object; ``is_done`` once the plan has ended.
    """

    ctrl: Array
    X_WO_ref: Array
    action_index: int
    phase_index: int
    is_done: bool
    failure: str | None

    __repr__ = brief_repr


def name_controller(controller: object) -> str:
    """Return how a record names ``controller``: module, but for a script's own, and name of the function or object's class."""
    named = controller if hasattr(controller, "__qualname__") else type(controller)
    module, name = getattr(named, "__module__", None), getattr(named, "__qualname__", type(named).__name__)
    return f"{module}.{name}" if module not in {None, "__main__"} else str(name)


def check_controller(controller: object) -> None:
    """Raise ControllerError where ``controller`` is none."""
    name = name_controller(controller)
    if isinstance(controller, type):
        raise ControllerError(name, "it is a class", f"an object of it is accepted, such as {name}()")
    for method in ("step", "reset"):
        found = getattr(controller, method, None)
        if found is not None and not callable(found):
            raise ControllerError(name, f"its {method} is of type {type(found).__name__}", NEEDED)
    if getattr(controller, "step", None) is None and not callable(controller):
        raise ControllerError(name, "it has no step and cannot be called", NEEDED)


def compute_target_limits(scene: Scene, joint_speed: float) -> tuple[Array, Array]:
    """Return the least and the greatest servo target (nu,) [rad] that can mean anything.

    A servo gives gain x (target - q) - damping x qdot, at most its torque limit.  Within the joint's range and up to
    ``joint_speed`` [rad/s] a target farther out asks for no more than the nearest one that is accepted: it is degrees for
    radians, a torque taken for a target, or an integral that ran away.
    """
    low, high = np.empty(scene.model.nu), np.empty(scene.model.nu)
    for finger, servos in zip(scene.fingers, scene.actuators, strict=True):
        beyond = (finger.torque_limit + finger.servo_damping * joint_speed) / finger.servo_gain
        low[servos], high[servos] = finger.chain.lower - beyond, finger.chain.upper + beyond
    limited = scene.model.actuator_ctrllimited.astype(bool)
    stated = scene.model.actuator_ctrlrange
    low[limited], high[limited] = stated[limited].T
    return low, high


class ForeignDriver:
    """Stands where dexplan's controller does and asks somebody else's, with the plan's clock beside it."""

    def __init__(
        self, controller: ForeignController, scene: Scene, reference: Reference, options: ControlOptions
    ) -> None:
        """``scene`` is what is believed.  Raises ControllerError for what is no controller."""
        check_controller(controller)
        self.name = name_controller(controller)
        self._scene, self._duration, self._tick = scene, reference.duration, options.tick
        self._clock = PlanClock(reference, [f.name for f in scene.fingers], options.tick)
        self._step: Any = getattr(controller, "step", None) or controller
        self._reset: Any = getattr(controller, "reset", None)
        self._lowest, self._highest = compute_target_limits(scene, options.joint_speed)
        self._servos = tuple(scene.model.actuator(a).name for a in range(scene.model.nu))
        self._is_reset = False

    def step(self, observation: Observation) -> ForeignCommand:
        """Return the command for the tick that starts now.  Raises ControllerError for an answer that is none."""
        now = self._clock.advance(observation.time, observation.touching)
        motion = self._find_motion(now)
        seen = replace(observation, motion=motion)
        for value in (motion, seen):
            # Made anew for every tick, so that a controller may keep them.
            for array in vars(value).values():
                if isinstance(array, np.ndarray):
                    array.setflags(write=False)
        if not self._is_reset:
            self._is_reset = True
            if self._reset is not None:
                self._ask("reset", self._reset, self._describe_start(seen), None)
        ctrl = self._read(self._ask("step", self._step, seen, seen.time), seen.time)
        phase = now.phase
        return ForeignCommand(
            ctrl, motion.X_WO, phase.action_index, phase.phase_index, now.is_done, now.failure
        )

    def _find_motion(self, now: PlanTime) -> PlannedMotion:
        X, V, A = now.phase.object_path.sample(now.t)
        X_next = now.phase.object_path.sample(now.t + self._tick).X_WO
        holding = np.zeros(self._scene.n_fingers, dtype=bool)
        holding[list(now.phase.holding)] = True
        return PlannedMotion(X, V, A, X_next, now.phase.action_index, now.phase.phase_index, now.t, holding)

    def _describe_start(self, observation: Observation) -> RunStart:
        fingers = self._scene.fingers
        return RunStart(
            self._scene.xml,
            self._tick,
            self._duration,
            tuple(f.name for f in fingers),
            tuple(name for f in fingers for name in f.joint_names),
            self._servos,
            self._lowest,
            self._highest,
            observation,
        )

    def _ask(self, what: str, function: Callable[[Any], object], told: object, time: float | None) -> object:
        """Call the user's code; whatever it raises becomes one sentence, with the error itself as its cause."""
        try:
            return function(told)
        except (Exception, SystemExit) as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            is_inside = place.filename != __file__
            where = f" ({Path(place.filename).name}, line {place.lineno})" if is_inside else ""
            said = f": {_shorten(str(error))}" if str(error) else ""
            fact = f"its {what} raised {type(error).__name__}{said}{where}"
            raise ControllerError(self.name, fact, "it has to return", time) from error

    def _read(self, given: object, time: float) -> Array:
        """Return what the controller answered as targets (nu,); raises ControllerError where they are none."""
        needed = f"an array ({len(self._servos)},) of servo targets [rad] in the order of observation.q.ravel() is accepted"
        if given is None:
            raise ControllerError(self.name, "it returned nothing (None)", needed, time)
        try:
            array: NDArray[Any] = np.asarray(given)
        except Exception:
            array = np.empty((), dtype=object)
        if array.dtype.kind not in "fiu":
            fact = f"it returned {_show(given)}, which is no array of numbers"
            raise ControllerError(self.name, fact, needed, time)
        if array.shape != (len(self._servos),):
            raise ControllerError(self.name, f"it returned an array of shape {array.shape}", needed, time)
        ctrl = array.astype(np.float64)
        for k in np.flatnonzero(~((ctrl >= self._lowest) & (ctrl <= self._highest)))[:1].tolist():
            value, servo = float(ctrl[k]), self._servos[k]
            least, most = self._lowest[k], self._highest[k]
            raise ControllerError(
                self.name,
                f"it returned {value:.6g} for {servo} (number {k})",
                f"a servo's target is a joint angle in radians, and from {least:.6g} to {most:.6g} is accepted there",
                time,
            )
        return ctrl


def _show(value: object) -> str:
    """Return ``value`` as text, or its type where it has none."""
    try:
        return _shorten(repr(value))
    except Exception:
        return f"a {type(value).__name__}"


def _shorten(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 1]}…"
