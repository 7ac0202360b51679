"""What a plan is made of: the four kinds of action, as values.

An action carries its motion, its ways and its times, so that a controller can carry it out without planning anything.  While a
plan is being made, arcs and times are missing; they are written last (``planning/actions/schedule.py``).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from dexplan.brief import brief_repr
from dexplan.plans.contacts import Contacts
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.pace import Pace
from dexplan.plans.phases import TRAVEL, PlannedPhase
from dexplan.plans.runner_up import RunnerUp
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array, read_only


@dataclass(frozen=True, eq=False)
class FingerWay:
    """How a free finger travels: ``finger`` passes ``postures`` (K, J) [rad] at even shares of its way, on a spline.

    ``is_detour``: something is in the way of the arc that the finger would take, and the way goes around it.  Raises ValueError
    for fewer than two postures.
    """

    finger: int
    postures: Array
    is_detour: bool = False

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "postures", read_only(self.postures))
        if self.postures.ndim != 2 or len(self.postures) < 2:
            raise ValueError(f"a way of shape {self.postures.shape}; (K, J) with K of 2 or more is accepted")


@dataclass(frozen=True, eq=False, kw_only=True)
class AbstractAction(ABC):
    """One symbolic step.

    ``motion`` is what the object does; ``grasping`` are the fingers that hold it throughout; ``contacts_end`` has one entry per
    finger, None where it is free.  ``ways`` are those of the fingers that travel, ``rolls`` says how fingers roll on the object
    meanwhile, at the progress of its motion.  ``why`` is the reason in words; ``limiting_finger`` and ``limit`` say what ended
    the motion of the object; ``margins`` what was left at the worst sample, in the units of ``plan.json``.
    """

    motion: ObjectMotion
    grasping: tuple[int, ...]
    contacts_end: Contacts
    phases: tuple[PlannedPhase, ...]
    why: str
    limiting_finger: int | None = None
    limit: str | None = None
    margins: Mapping[str, float] = field(default_factory=dict)
    ways: tuple[FingerWay, ...] = ()
    rolls: tuple[TipRoll, ...] = ()

    __repr__ = brief_repr

    @property
    @abstractmethod
    def name(self) -> str:
        """What the action is called in files, captions and reports."""

    @property
    def X_WO_start(self) -> Array:
        """The object's pose (4, 4) before the action."""
        return self.motion.X_WO_start

    @property
    def X_WO_end(self) -> Array:
        """The object's pose (4, 4) after the action."""
        return self.motion.X_WO_end

    @property
    def is_timed(self) -> bool:
        """Whether the action has all ways and times that a controller needs."""
        return all(phase.duration is not None for phase in self.phases)

    @property
    def duration(self) -> float:
        """Planned duration [s].  Raises ValueError for an action that has not been timed."""
        total = 0.0
        for phase in self.phases:
            if phase.duration is None:
                raise ValueError(f"{self.name} has not been timed; time the plan first")
            total += phase.duration
        return total


@dataclass(frozen=True, eq=False, kw_only=True)
class Hold(AbstractAction):
    """The fingers hold the object still."""

    __repr__ = brief_repr

    @property
    def name(self) -> str:
        """What the action is called in files, captions and reports."""
        return "hold"


@dataclass(frozen=True, eq=False, kw_only=True)
class Roll(AbstractAction):
    """Fingers roll on the resting object while all that touch hold it; ``pace`` None until the plan has been timed."""

    pace: Pace | None = None

    __repr__ = brief_repr

    @property
    def name(self) -> str:
        """What the action is called in files, captions and reports."""
        return "roll"

    @property
    def is_timed(self) -> bool:
        """Whether the action has all ways and times that a controller needs."""
        return super().is_timed and self.pace is not None


@dataclass(frozen=True, eq=False, kw_only=True)
class MoveObject(AbstractAction):
    """The fingers turn and shift the object; ``pace`` None until the plan has been timed.

    Some of them may roll on it meanwhile, and a free finger may travel between its hovers and its home.
    """

    pace: Pace | None = None

    __repr__ = brief_repr

    @property
    def name(self) -> str:
        """What the action is called in files, captions and reports."""
        return "move_object"

    @property
    def is_timed(self) -> bool:
        """Whether the action has all ways and times that a controller needs."""
        return super().is_timed and self.pace is not None


@dataclass(frozen=True, eq=False, kw_only=True)
class Relocate(AbstractAction):
    """``finger`` is placed on the object, or lifted from it, while the others hold it still.

    ``runner_up`` is what would have been placed instead; None where the search thought of nothing else, or there was none.
    """

    finger: int
    runner_up: RunnerUp | None = None

    __repr__ = brief_repr

    @property
    def name(self) -> str:
        """What the action is called in files, captions and reports."""
        return "place" if self.is_placing else "lift"

    @property
    def is_timed(self) -> bool:
        """Whether the action has all ways and times that a controller needs."""
        return super().is_timed and (bool(self.ways) or not self.has_travel)

    @property
    def is_placing(self) -> bool:
        """Whether the finger comes down; else it leaves."""
        return self.contacts_end[self.finger] is not None

    @property
    def has_travel(self) -> bool:
        """Whether the finger's way from or to its home is part of the action; else the motion of the object next to it has it."""
        return any(phase.name == TRAVEL for phase in self.phases)


Action = Hold | Roll | MoveObject | Relocate


def count_placements(actions: Iterable[Action]) -> int:
    """Return how many times a finger is placed."""
    return sum(isinstance(action, Relocate) and action.is_placing for action in actions)
