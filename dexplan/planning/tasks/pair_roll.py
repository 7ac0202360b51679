"""A pair beside which no third finger finds room rolls first, until there is some.

Another finger takes over from one of a pair by landing within reach of friction of the place opposite the other.  Where the two
are exactly opposite, that place is taken by the fingertip that is to be relieved: what is left is a ring as wide as the opening
of the friction cones is wider than two fingertips, next to nothing or less, and turning the object changes nothing about it.
Rolling does: "use rolling to obtain a FC grasp" from which one can go on [paper §1].  Each contact rolls along a great circle
while both hold, so that they come to stand a little less opposite, and a third finger finds room on the other side.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from dexplan.planning.admissible.admissibility import Admissibility, worst
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.gait.escape import LONGEST_TURN_COST, MOST_PLACES_COUNTED, count_room_at, find_places
from dexplan.planning.gait.routes import build_routes
from dexplan.planning.rolling.roll_gait import STEP, follow_roll, judge_ways
from dexplan.planning.rolling.roll_to_goal import Rolled
from dexplan.planning.rolling.rolls import build_roll, end_placement
from dexplan.plans.actions import Roll
from dexplan.plans.contacts import Placement, list_holding
from dexplan.plans.goal import RotationGoal
from dexplan.plans.motion import rest_at
from dexplan.plans.phases import PlannedPhase, demand_touch
from dexplan.plans.refusal import Refusal, RefusalCount, RefusalKind
from dexplan.spatial import Array, build_frame, lock_arrays

HEADINGS = 12
"""Directions in which a contact may roll, evenly around its normal."""
ANGLES = np.radians((4.0, 8.0, 12.0, 16.0, 20.0, 26.0))
"""How far the two contacts roll in all [rad on the object]."""
SHARES = ((0.5, 0.5), (1.0, 0.0), (0.0, 1.0))
"""What each of the two does of it."""
ALIKE = float(np.cos(np.radians(6.0)))
"""Grasps whose contacts are nearer to one another than this count as one."""


@dataclass(frozen=True)
class _Candidate:
    """Both contacts roll towards ``toward`` (3,), in object axes, by ``angles`` [rad]; ``score`` is what that is worth."""

    score: float
    toward: Array
    angles: tuple[float, float]
    normals_W: tuple[Array, Array]

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(eq=False)
class PairRolls:
    """Looks for ways to roll the ``contacts`` of a pair that holds the object, so that a third finger finds room beside them."""

    hand: HandModel
    goal: RotationGoal
    contacts: tuple[Placement | None, ...]
    admissibility: Admissibility
    refusals: RefusalCount = field(default_factory=RefusalCount)

    def options(self) -> Iterator[Rolled]:
        """Yield admissible rolls, what gives room and rolls little first; grasps that are much alike are offered once."""
        a, b = self._pair
        taken: list[tuple[Array, Array]] = []
        for one in sorted(self._survey(a, b), key=lambda c: -c.score):
            if any(min(x @ y for x, y in zip(one.normals_W, seen, strict=True)) > ALIKE for seen in taken):
                continue
            rolled, refusal = self._roll(a, b, one)
            if rolled is None:
                if refusal is not None:
                    self.refusals.add(refusal)
                continue
            taken.append(one.normals_W)
            yield rolled

    def explain(self) -> Refusal:
        """Return the commonest reason why there is none."""
        common = self.refusals.list_common(1)
        return common[0] if common else Refusal(RefusalKind.NO_ROOM)

    @property
    def _pair(self) -> tuple[Placement, Placement]:
        a, b = (c for c in self.contacts if c is not None)
        return a, b

    def _survey(self, a: Placement, b: Placement) -> list[_Candidate]:
        """Return the rolls after which a free finger finds room, by geometry and loads alone."""
        hand, R_WO = self.hand, self.goal.X_WO_start[:3, :3]
        table = ContactTable(hand, build_routes(self.goal)[0][0])
        places = find_places(table, {a.finger, b.finger})
        frame, found = build_frame(a.normal_O), []
        for k, angle, shares in product(range(HEADINGS), ANGLES.tolist(), SHARES):
            azimuth = 2.0 * np.pi * k / HEADINGS
            toward = np.cos(azimuth) * frame[:, 0] + np.sin(azimuth) * frame[:, 1]
            angles = (angle * shares[0], angle * shares[1])
            ends = [_advance(c.normal_O, toward, x) for c, x in zip((a, b), angles, strict=True)]
            if not all(hand.object.allows(np.stack(ends))) or -(ends[0] @ ends[1]) < np.cos(
                2.0 * table.beta_max
            ):
                continue
            normals = {c.finger: R_WO @ n for c, n in zip((a, b), ends, strict=True)}
            if room := count_room_at(table, normals, places):
                score = (
                    min(room, MOST_PLACES_COUNTED) / MOST_PLACES_COUNTED
                    - LONGEST_TURN_COST * angle / ANGLES[-1]
                )
                found.append(_Candidate(score, toward, angles, (normals[a.finger], normals[b.finger])))
        return found

    def _roll(self, a: Placement, b: Placement, one: _Candidate) -> tuple[Rolled | None, Refusal | None]:
        """Return the roll with its margins, or why it cannot be done."""
        count = max(16, int(np.ceil(max(one.angles) / STEP)) + 1)
        ways, rolls, after = {}, [], list(self.contacts)
        for contact, angle in zip((a, b), one.angles, strict=True):
            ways[contact.finger] = np.repeat(contact.q[None], count, axis=0)
            if angle == 0.0:
                continue
            roll = build_roll(self.hand, contact, one.toward, angle, count)
            ways[contact.finger], refusal = follow_roll(self.hand, self.goal.X_WO_start, roll, contact.q)
            if refusal:
                return None, refusal
            rolls.append(roll)
            after[contact.finger] = end_placement(self.hand, roll, contact, ways[contact.finger][-1])
        rows, refusal = judge_ways(self.hand, self.admissibility, self.goal.X_WO_start, ways)
        if refusal:
            return None, refusal
        return Rolled(tuple(rolls), tuple(after), worst(rows)), None


def _advance(normal: Array, toward: Array, angle: float) -> Array:
    """Return ``normal`` (3,) moved by ``angle`` [rad] towards ``toward`` (3,) along the great circle through both."""
    aside = toward - (toward @ normal) * normal
    return np.cos(angle) * normal + np.sin(angle) * aside / np.linalg.norm(aside)


def build_pair_roll_action(hand: HandModel, goal: RotationGoal, rolled: Rolled) -> Roll:
    """Return the action of a pair's roll: both fingers hold throughout."""
    who = " and ".join(hand.fingers[r.finger].name for r in rolled.rolls)
    return Roll(
        motion=rest_at(goal.X_WO_start, goal.axis_W),
        grasping=list_holding(rolled.contacts),
        contacts_end=rolled.contacts,
        phases=(PlannedPhase("roll", demand_touch(rolled.contacts)),),
        why=f"no gait was found from the start contacts; after a roll of {who} another finger finds room",
        margins=rolled.margins,
        rolls=rolled.rolls,
    )
