"""From three fingers to two by rolling [paper §1, §3]: a pair rolls towards opposite places until it holds the object alone.

Where no two of the contacts are force closed nothing can be lifted, so only rolling can make a new grasp.  The pair with the
largest straight-line distance rolls along its great circle, both fingers by the same angle, which is the shortest way to a
two-finger grasp [paper §3, figure 1]; the third finger stays, or rolls along to keep the three-finger grasp closed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from dexplan.brief import brief_repr
from dexplan.errors import spell_apart
from dexplan.grasp.pairs import measure_chord_lean
from dexplan.kinematics.arcs import build_travel, compute_hover, refine
from dexplan.kinematics.chain import compute_joint_margin, solve_ik, wrap_near
from dexplan.kinematics.following import follow_tip
from dexplan.planning.admissible.admissibility import Admissibility, Margins, compute_finger_states, worst
from dexplan.planning.admissible.conditions import refuse_nearness
from dexplan.planning.admissible.hand import HandModel, compute_travel_margin
from dexplan.planning.admissible.separation import compute_pair_angle_max
from dexplan.planning.admissible.tip_rotation import (
    ROUNDING,
    measure_rotation,
    refuse_sweep,
    trace_on_tip,
)
from dexplan.planning.rolling.rolls import build_roll, end_placement, get_direction
from dexplan.plans.actions import Relocate, Roll
from dexplan.plans.contacts import Placement, list_holding
from dexplan.plans.motion import rest_at
from dexplan.plans.phases import PlannedPhase, build_lifting, demand_touch
from dexplan.plans.refusal import Key, Refusal, RefusalCount, RefusalKind
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array, lock_arrays, rotate_about

STEP = float(np.radians(1.0))
"""Ways are checked this often along the object, and pairs opened in these steps [rad]."""
FOLLOW = (0.0, 5.0, 10.0, 15.0, -5.0)
"""How far the third finger may roll along, away from the middle of the pair [deg on the object]."""
WIDEST = float(np.radians(24.0))
"""No pair is opened by more than this beyond the first that closes."""


@dataclass(frozen=True, eq=False)
class RollPlan:
    """How fingers roll from one grasp to the next while they hold the object still.

    ``rolls`` of the fingers that roll; ``contacts`` of all fingers afterwards; ``pair`` the fingers that then hold alone and
    ``lifted`` those that are lifted; ``margins`` the worst along the way, ``pair_margins`` those of the pair at its end.
    """

    rolls: tuple[TipRoll, ...]
    contacts: tuple[Placement | None, ...]
    pair: tuple[int, int]
    lifted: int
    margins: dict[str, float] = field(default_factory=dict)
    pair_margins: dict[str, float] = field(default_factory=dict)

    __repr__ = brief_repr


def follow_roll(hand: HandModel, X_WO: Array, roll: TipRoll, q_start: Array) -> tuple[Array, Refusal | None]:
    """Return the postures along a roll, and why it cannot be done to its end (None where it can).

    ``X_WO`` (4, 4) or (K, 4, 4) is where the object is; the postures (L, J) stop with the last one that can be held.
    """
    description, limits = hand.fingers[roll.finger], hand.limits
    chain, count, name = description.chain, roll.count, description.name
    X_WF = X_WO @ roll.X_OF
    lean = np.arccos(np.clip(-np.sum(roll.X_OF[:, :3, 2] * roll.normal_O, axis=1), -1.0, 1.0))
    q = follow_tip(chain, X_WF, q_start)
    while len(q) < count:
        # Near a singular posture joints may turn faster than the tip's steps let expect: step by step they go on.
        guess = 2.0 * q[-1] - q[-2] if len(q) > 1 else q[0]
        solved, reached = solve_ik(chain, X_WF[len(q)][None], guess[None])
        if not reached[0]:
            break
        q = np.vstack([q, wrap_near(solved[0], guess)])
    leans = np.flatnonzero(lean[1 : len(q)] > hand.tip_polar_limit) + 1
    stops = np.flatnonzero(compute_joint_margin(chain, q[1:]) < limits.joint_margin) + 1
    swept = measure_rotation(trace_on_tip(roll))
    rounds = np.flatnonzero(swept[1 : len(q)] > hand.tip_rotation_limit + ROUNDING) + 1
    first = min((int(rows[0]) for rows in (leans, stops, rounds) if len(rows)), default=len(q))
    if first in leans:
        far, most = spell_apart(np.degrees(lean[first]), np.degrees(hand.tip_polar_limit), 0)
        words = f"{name} would roll {far} deg off its tip's pole, and {most} deg are allowed"
        limit = hand.tip_polar_limit
        return q[:first], Refusal(RefusalKind.TIP_POLE, (name,), float(lean[first]), limit, words=words)
    if first in rounds:
        return q[:first], refuse_sweep(hand, roll.finger, float(swept[first]))
    if first in stops:
        words = f"{name} comes to a joint limit while it rolls"
        return q[:first], Refusal(RefusalKind.JOINT_LIMIT, (name,), words=words)
    if len(q) < count:
        words = f"{name} comes to the end of its workspace while it rolls"
        return q, Refusal(RefusalKind.OUT_OF_REACH, (name,), words=words)
    return q, None


def judge_ways(
    hand: HandModel, admissibility: Admissibility, X_WO: Array, ways: dict[int, Array], explain: bool = False
) -> tuple[list[Margins], Refusal | None]:
    """Return the margins of holding the object at ``X_WO`` (4, 4) with all fingers of ``ways`` along their postures (K, J).

    Stops at the first sample that is refused, with the refusal (None where there is none); the end is asked first.  ``explain``:
    a refusal for the load names what is short, which takes longer than the rest.
    """
    states = {i: compute_finger_states(hand, i, way) for i, way in ways.items()}
    count = len(next(iter(ways.values())))
    rows: list[Margins] = []
    for k in (count - 1, *range(count - 1)):
        q = hand.q_home.copy()
        for finger, way in ways.items():
            q[finger] = way[k]
        here = {i: rows_i[k] for i, rows_i in states.items()}
        rows.append(admissibility.compute_margins_of(here, q, X_WO, explain=explain))
        if not rows[-1].is_admissible:
            return rows, rows[-1].refusal
    return rows, None


@dataclass(frozen=True, eq=False)
class _PairRoll:
    """How two tips roll apart: their rolls, the postures (K, J) [rad] of each on the way, and why it fails, if it does."""

    rolls: list[TipRoll]
    ways: dict[int, Array]
    refusal: Refusal | None

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(eq=False)
class RollToPair:
    """Looks for ways to roll three holding fingers so that two of them hold alone."""

    hand: HandModel
    X_WO: Array
    contacts: tuple[Placement | None, ...]
    admissibility: Admissibility
    refusals: RefusalCount = field(default_factory=RefusalCount)
    _first_refused: dict[Key, dict[int, Array]] = field(default_factory=dict)

    def options(self) -> Iterator[RollPlan]:
        """Yield admissible rolls, pairs in the order of their straight-line distance, the smallest opening first."""
        touching = [c for c in self.contacts if c is not None]
        pairs = sorted(combinations(touching, 2), key=lambda p: -_distance(*p))
        for a, b in pairs:
            for third in (c for c in touching if c is not a and c is not b):
                yield from self._open(a, b, third)

    def explain(self) -> tuple[Refusal, ...]:
        """Return the most common reasons why a way was refused, those of a load with what is short."""
        return tuple(map(self._name, self.refusals.list_common(2))) or (Refusal(RefusalKind.PAIR_NOT_OPENED),)

    def _name(self, refusal: Refusal) -> Refusal:
        ways = self._first_refused.get(refusal.key)
        if ways is None:
            return refusal
        named = judge_ways(self.hand, self.admissibility, self.X_WO, ways, explain=True)[1]
        return named or refusal

    def _open(self, a: Placement, b: Placement, third: Placement) -> Iterator[RollPlan]:
        one, other = (get_direction(self.hand, x) for x in (a, b))
        now = float(np.arccos(np.clip(one @ other, -1.0, 1.0)))
        first = self.find_first_opening(a, b, now)
        openings = np.arange(first, min(first + WIDEST, np.pi - now), STEP).tolist()
        # A pair that holds alone needs no opening, and exactly opposite contacts have none left.
        for wider in openings or ([0.0] if first == 0.0 else []):
            if (found := self.open_pair(a, b, third, wider)) is not None:
                yield found

    def find_first_opening(self, a: Placement, b: Placement, now: float) -> float:
        """Return by how much farther two contacts have to be apart than ``now``, as seen from the object's origin, until they are
        force closed with a margin [rad]; pi where they never are, or an edge is in the way.
        """
        limits, body = self.hand.limits, self.hand.object.body
        beta = compute_pair_angle_max(self.hand.friction.scaled(limits.cone_share)) - limits.closure_margin
        if self.hand.object.is_isotropic:
            return max(np.pi - 2.0 * beta - now, 0.0)
        one, other = (get_direction(self.hand, x) for x in (a, b))
        axis = np.cross(one, other)
        if not body.is_smooth or np.linalg.norm(axis) < 1e-9:
            return float(np.pi)
        axis /= np.linalg.norm(axis)
        wider = np.arange(0.0, np.pi - now, STEP)
        apart = [rotate_about(axis, 0.5 * w) for w in wider]
        points = body.radial(np.stack([[R.T @ one, R @ other] for R in apart]))
        closed = measure_chord_lean(points, body.normal_at(points)) < beta
        return float(wider[closed.argmax()]) if closed.any() else float(np.pi)

    def open_pair(self, a: Placement, b: Placement, third: Placement, wider: float) -> RollPlan | None:
        """Return how ``a`` and ``b`` roll apart by ``wider`` [rad] in all; None, and the refusals counted, where they cannot."""
        # Whether the pair can roll and then holds alone does not depend on where the third finger goes meanwhile.
        pair = self._roll_pair(a, b, wider)
        if pair.refusal:
            self.refusals.add(pair.refusal)
            return None
        for follow in FOLLOW:
            found, refusal = self._try(pair, (a, b, third), float(np.radians(follow)))
            if found is not None:
                return found
            if refusal:
                self.refusals.add(refusal)
        return None

    def _judge(self, ways: dict[int, Array]) -> tuple[list[Margins], Refusal | None]:
        """Judge ways; note the first of every kind that is refused."""
        rows, refusal = judge_ways(self.hand, self.admissibility, self.X_WO, ways)
        if refusal:
            self._first_refused.setdefault(refusal.key, ways)
        return rows, refusal

    def _roll_pair(self, a: Placement, b: Placement, wider: float) -> _PairRoll:
        """Return how the pair opens by ``wider`` [rad]."""
        count = max(16, int(np.ceil(0.5 * wider / STEP)) + 1)
        rolls: list[TipRoll] = []
        ways = {x.finger: np.repeat(x.q[None], count, axis=0) for x in (a, b)}
        for x, y in ((a, b), (b, a)):
            if wider > 0.0:
                roll = build_roll(self.hand, x, -get_direction(self.hand, y), 0.5 * wider, count)
                ways[x.finger], refusal = follow_roll(self.hand, self.X_WO, roll, x.q)
                if refusal:
                    return _PairRoll(rolls, ways, refusal)
                rolls.append(roll)
        return _PairRoll(rolls, ways, self._judge({finger: way[-1:] for finger, way in ways.items()})[1])

    def _try(
        self,
        pair: _PairRoll,
        fingers: tuple[Placement, Placement, Placement],
        follow: float,
    ) -> tuple[RollPlan | None, Refusal | None]:
        """Return the plan in which the pair rolls as given while the third finger rolls by ``follow`` [rad]; else why not."""
        a, b, third = fingers
        count = len(pair.ways[a.finger])
        rolls, ways = list(pair.rolls), {**pair.ways, third.finger: np.repeat(third.q[None], count, axis=0)}
        if follow != 0.0:
            toward = -get_direction(self.hand, a) - get_direction(self.hand, b)
            if np.linalg.norm(np.cross(toward, get_direction(self.hand, third))) < 1e-9:
                # It stands opposite the other two already: there is no side to which it could follow.
                return None, None
            rolls.append(build_roll(self.hand, third, toward, follow, count))
            ways[third.finger], refusal = follow_roll(self.hand, self.X_WO, rolls[-1], third.q)
            if refusal:
                return None, refusal
        rows, refusal = self._judge(ways)
        if refusal:
            return None, refusal
        contacts = list(self.contacts)
        for roll in rolls:
            before = contacts[roll.finger]
            assert before is not None
            contacts[roll.finger] = end_placement(self.hand, roll, before, ways[roll.finger][-1])
        held, refusal = self._check_lift(tuple(contacts), (a.finger, b.finger), third.finger)
        if held is None:
            return None, refusal
        return (
            RollPlan(
                tuple(rolls), tuple(contacts), (a.finger, b.finger), third.finger, worst(rows), held.as_dict()
            ),
            None,
        )

    def _check_lift(
        self, contacts: tuple[Placement | None, ...], pair: tuple[int, int], lifted: int
    ) -> tuple[Margins | None, Refusal | None]:
        """Return the margins of holding with the pair alone once the third finger has gone home; else why it cannot go."""
        q = self.hand.q_home.copy()
        for finger in pair:
            placement = contacts[finger]
            assert placement is not None
            q[finger] = placement.q
        held = self.admissibility.compute_margins(q, self.X_WO, tuple(sorted(pair)))
        if not held.is_admissible:
            return None, held.refusal
        third, description = contacts[lifted], self.hand.fingers[lifted]
        assert third is not None
        hover = compute_hover(description, self.X_WO, third.X_OF, third.normal_O, third.q, self.hand.hover)
        way = build_travel(description, description.q_home, hover, self.X_WO[:3, 3])
        margin = float(compute_joint_margin(description.chain, refine(way)).min())
        if margin < compute_travel_margin(self.hand, lifted):
            needed = compute_travel_margin(self.hand, lifted)
            cause = Refusal(RefusalKind.JOINT_LIMIT, (description.name,), margin, needed)
            words = f"{description.name} comes within {np.degrees(margin):.1f} deg of a joint limit when it leaves"
            return None, Refusal(RefusalKind.CANNOT_LEAVE, cause.subject, because=(cause,), words=words)
        nearest = self.admissibility.find_nearest_on_path(q, self.X_WO, lifted, way, pair)
        if nearest.distance < self.hand.limits.clearance:
            cause = refuse_nearness(nearest, self.hand.limits.clearance)
            return None, Refusal(RefusalKind.CANNOT_LEAVE, (description.name,), because=(cause,))
        return held, None


def build_roll_actions(plan: RollPlan, hand: HandModel, X_WO: Array, axis_W: Array) -> tuple[Roll, Relocate]:
    """Return the actions of a roll plan: all fingers that touch hold while some roll, then the third one lifts."""
    after = tuple(None if i == plan.lifted else c for i, c in enumerate(plan.contacts))
    i, j = (hand.fingers[f].name for f in plan.pair)
    still = rest_at(X_WO, axis_W)
    roll = Roll(
        motion=still,
        grasping=list_holding(plan.contacts),
        contacts_end=plan.contacts,
        phases=(PlannedPhase("roll", demand_touch(plan.contacts)),),
        why=f"no two contacts are force closed; {i} and {j} roll apart until they are",
        margins=plan.margins,
        rolls=plan.rolls,
    )
    lift = Relocate(
        finger=plan.lifted,
        motion=still,
        grasping=plan.pair,
        contacts_end=after,
        phases=build_lifting(plan.lifted, plan.contacts, after),
        why=f"{i} and {j} now hold alone",
        margins=plan.pair_margins,
    )
    return roll, lift


def _distance(a: Placement, b: Placement) -> float:
    """Return the straight-line distance [m], rounded so that equal pairs stay in the fingers' order."""
    return round(float(np.linalg.norm(a.point_O - b.point_O)), 9)
