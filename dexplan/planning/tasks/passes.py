"""What is tried with every way to goal contacts, and in which order: little with all of them, then more; and what came of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from dexplan.plans.actions import Action
from dexplan.plans.contacts import Contacts
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.refusal import Refusal, RefusalKind

USUAL_BUDGET = 2_000
"""The default of ``gait.node_budget``, for which limits on work in tasks with goal contacts are meant; more multiplies them."""
REST_ANGLES = tuple(np.radians((0.0, 40.0, 80.0)).tolist())
"""So much of the object's turn [rad] is left to that search, in the order in which it is tried: enough for fingers to find room
on the way, and little enough for the search to stay small."""
REST_SHIFT = 0.25
"""So much of a shift [m] counts as a turn by one radian there."""


class Pass(NamedTuple):
    """What is tried with every way: one of the ``REST_ANGLES``, how many ends of gaits, and how long each of them is sought.

    ``rest`` is the number of the angle; ``depth`` that of the largest of ``ends.BUDGETS`` that a gait may use.
    """

    rest: int
    ends: int
    depth: int


Passes = tuple[Pass, ...]
PASSES: Passes = tuple(
    Pass(*row)
    for row in (
        *((0, 1, 0), (1, 1, 0), (0, 2, 1), (1, 2, 1), (2, 2, 1), (0, 2, 2), (1, 2, 2), (0, 4, 3)),
        *((1, 4, 3), (2, 4, 3), (0, 12, 3), (1, 12, 3), (2, 12, 3)),
    )
)
"""Every way gets a short gait, one end of it, and some of the object's turn, before any gets a second end or a long gait: the one
that a gait does not come to must not use up the work of those that it would come to at once."""


@dataclass(frozen=True, eq=False)
class GraspWay:
    """One way to goal contacts: the object goes through ``before``, the goal grasp is made, and carries it through ``after``.

    ``is_attitude``: any way to the end of ``before`` will do.  ``is_simultaneous``: goal contacts may be taken on the way.
    """

    before: ObjectMotion
    after: ObjectMotion
    is_attitude: bool = True
    is_simultaneous: bool = False


@dataclass(frozen=True)
class Allowance:
    """How much may be tried with a way.

    Nothing is begun after so much ``work`` in all; what costs as much as ``cost`` for sure is left out.  ``part`` says which
    share of the way is left to the search and how much is tried; None: all shares, one after another.
    """

    work: float = np.inf
    part: Pass | None = None
    cost: float = np.inf


UNLIMITED = Allowance()


class Stop(IntEnum):
    """Where a way to the goal ends, the farthest first."""

    SEARCH = 0
    """The search for the adjustment came to no goal contacts."""
    ENTRY = 1
    """There is no way into the goal grasp."""
    GAIT = 2
    """The object was not brought to where the grasp would be adjusted."""
    GOAL_GRASP = 3
    """The goal grasp does not hold, or does not carry the object on."""
    NOT_BEGUN = 4
    """The work was used up before."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """The actions and start contacts of a way to the goal; none, and ``why``, where none was found.

    ``stop`` says how far the way came that ``why`` is about.  ``gave_up``: something was left to try, so that nothing is said
    about whether there is a way.  ``number`` of the way that was found among several, ``tried`` how many of them were begun;
    ``ran_out``: the work that may be done was used up.
    """

    actions: tuple[Action, ...] = ()
    start: Contacts = ()
    why: Refusal | None = None
    stop: Stop = Stop.SEARCH
    gave_up: bool = False
    number: int | None = None
    tried: int = 1
    ran_out: bool = False

    @property
    def is_found(self) -> bool:
        """Whether the way comes to the goal."""
        return self.why is None


NOT_BEGUN = Outcome(why=Refusal(RefusalKind.WORK_USED_UP), stop=Stop.NOT_BEGUN, gave_up=True)


def choose_rests(motion: ObjectMotion, is_on_sites: bool = False) -> tuple[float, ...]:
    """Return the shares of a motion that are left to the search that adjusts the grasp; gaits do what comes before.

    On sites the search does all of it, as far as each pass has work for.
    """
    if motion.is_still:
        return (0.0,)
    if is_on_sites:
        return (1.0,) * len(REST_ANGLES)
    size = max(abs(motion.angle), float(np.linalg.norm(motion.shift_W)) / REST_SHIFT)
    shares = [min(1.0, angle / size) for angle in REST_ANGLES]
    return tuple(dict.fromkeys(shares))


def scale_work(work: int, node_budget: int) -> int:
    """Return the work that may be done where ``work`` is meant for the usual budget of nodes."""
    return int(work * max(1.0, node_budget / USUAL_BUDGET))


def explain_giving_up(done: Outcome, opened: int, tried: str, node_budget: int) -> str:
    """Return in words after how many nodes a search gave up, what it ``tried`` and met, and what would let it go on.

    Friction, weight and the like are not named as what would help: nothing was shown to be short.
    """
    where = f" ({tried})" if tried else ""
    cure = (
        f"a gait.node_budget above {max(node_budget, USUAL_BUDGET)} lets it go on"
        if done.ran_out
        else "all that is ever tried was tried, so choose other goal contacts or another start grasp"
    )
    return f"the search gave up after {opened} nodes{where}, and there may be a way: {done.why}; {cure}"
