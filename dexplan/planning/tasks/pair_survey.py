"""Can any two fingers hold the object at a pose, all others free at home?  And if not, what is it that stands in the way?

All directions of a fine grid are asked about, for every pair of fingers, each with the posture it would really have: whether two
contacts are in each other's way depends on both.  What stands in the way is found by leaving conditions out one at a time: what
makes a pair hold once it is left out is the cause, and only such a cure is named.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dexplan.contact.friction import SoftFinger
from dexplan.errors import spell_apart
from dexplan.icosphere import build_icosphere
from dexplan.kinematics.chain import compute_tip_pose
from dexplan.kinematics.spherical_wrist import estimate_dexterity, solve_near, solve_tip_pose
from dexplan.planning.admissible.admissibility import Admissibility, compute_finger_states
from dexplan.planning.admissible.aligned import build_aligned
from dexplan.planning.admissible.conditions import Condition, find_unmet, refuse_nearness
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.loads import compute_object_wrench, compute_pair_loads
from dexplan.planning.admissible.lone_clearance import LEVEL, list_others
from dexplan.planning.admissible.order import keeps_order
from dexplan.planning.admissible.separation import compute_opposition, compute_pair_angle_max
from dexplan.plans.refusal import Cure, Refusal, RefusalCount, RefusalKind
from dexplan.scene.description import STANDING, Nearness
from dexplan.spatial import Array

MOST = 6_000
"""Pairs of two fingers that are looked at before none is taken to hold; where more are far enough apart, a spread of them."""
CHUNK = 500
"""Pairs that are looked at in one go."""
LOOKED_AT, OVERLOADED = 40, 4
"""Pairs of one go that are looked at exactly, and those refused for their load before the others are taken to be."""
HIGH_FRICTION = 1.5
"""The sliding friction with which is tried whether friction is what is short."""
LIGHT = 0.01
"""The share of its mass with which is tried whether the object's weight is what is too much."""

OVERLOAD, OUT_OF_ORDER = Refusal(RefusalKind.LOAD), Refusal(RefusalKind.ORDER)
OUT_OF_REACH = Refusal(RefusalKind.OUT_OF_REACH, words="it lies outside their workspaces")

Pair = tuple[int, int, int, int]
"""Two fingers, and the direction of each on the grid."""


@dataclass(eq=False)
class PairSurvey:
    """Pairs of contacts around an object at ``X_WO`` (4, 4); answers are kept.

    ``without``: the condition that is left out, to see what follows.  ``refusals`` counts why pairs that are far enough apart do
    not hold.
    """

    hand: HandModel
    X_WO: Array
    admissibility: Admissibility
    without: Condition | None = None
    refusals: RefusalCount = field(default_factory=RefusalCount)

    def __post_init__(self) -> None:
        hand = self.hand
        if self.without is Condition.FRICTION:
            hand = replace(hand, friction=SoftFinger(HIGH_FRICTION, hand.friction.torsional))
        elif self.without is Condition.WEIGHT:
            hand = replace(hand, object=hand.object.weighing(LIGHT * hand.object.mass))
        if hand is not self.hand:
            self.hand, self.admissibility = hand, Admissibility(hand)
        self._center = self.X_WO[:3, 3]
        self._normals = build_icosphere(LEVEL).vertices
        self._postures: dict[int, Array] = {}
        self._usable: dict[int, NDArray[np.intp]] = {}
        self._nearest: dict[tuple[int, int, tuple[int, ...]], Nearness] = {}

    def find_pair(self) -> Pair | None:
        """Return two fingers and the directions along which they hold the object; None if no two are found that do."""
        fingers = range(len(self.hand.fingers))
        for i, j in combinations(fingers, 2):
            waiting = [f for f in fingers if f not in (i, j)]
            if self._has_waiting_fault(waiting):
                continue
            if (found := self._find_pair_of(i, j)) is not None:
                return found
        return None

    def leave_out(self, condition: Condition) -> PairSurvey:
        """Return the survey of the same pose without one condition; what is near to what is kept where that is the same."""
        other = PairSurvey(self.hand, self.X_WO, self.admissibility, condition)
        if condition in (Condition.ALLOWED, Condition.FRICTION, Condition.WEIGHT):
            other._nearest = self._nearest
        return other

    def get_normal(self, direction: int) -> Array:
        """Return the outward normal (3,) in W along a direction of the grid."""
        return self._normals[direction]

    def _has_waiting_fault(self, waiting: list[int]) -> bool:
        """Return whether something comes too near to a finger that waits at home, wherever the others are, and count that."""
        found = False
        for finger in waiting if self.without is not Condition.WAITING else ():
            nearest = find_nearest_at_home(self.hand, self.X_WO, finger, self._left_out)
            if nearest.distance < self.hand.limits.clearance:
                name, cause = (
                    self.hand.fingers[finger].name,
                    refuse_nearness(nearest, self.hand.limits.clearance),
                )
                self.refusals.add(Refusal(RefusalKind.WAITING, (name,), because=(cause,)))
                found = True
        return found

    @property
    def _left_out(self) -> tuple[int, ...]:
        return (STANDING,) if self.without is Condition.STANDING else ()

    # -- one contact -----------------------------------------------------------------------------------------------------

    def find_usable(self, finger: int) -> NDArray[np.intp]:
        """Return the directions (N,) of the grid along which a finger can touch, as far as its joints are concerned."""
        if finger not in self._usable:
            self._usable[finger] = self._find_usable(finger)
        return self._usable[finger]

    def _find_usable(self, finger: int) -> NDArray[np.intp]:
        hand, description = self.hand, self.hand.fingers[finger]
        chain, workspace = description.chain, hand.workspaces[finger]
        X_WF = build_aligned(hand, finger, self._center, self._normals)
        if self.without is Condition.JOINTS or not len(workspace.postures):
            q, reached = solve_near(chain, X_WF, np.tile(description.q_home, (len(X_WF), 1)))
        else:
            q, reached = solve_tip_pose(workspace, X_WF)
        if chain.has_tip_roll:
            q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
        ok = reached.copy()
        # Out of reach some answers are the nearest that there are.
        ok[ok] = (
            np.linalg.norm(compute_tip_pose(chain, q[ok])[:, :3, 3] - X_WF[ok, :3, 3], axis=1)
            < hand.limits.clearance
        )
        if self.without is not Condition.JOINTS:
            ok &= np.minimum(q - chain.lower, chain.upper - q).min(axis=1) >= hand.limits.joint_margin
        if self.without is not Condition.ALLOWED:
            ok &= hand.object.allows(self._normals @ self.X_WO[:3, :3])
        ok[ok] = estimate_dexterity(chain, q[ok]) >= hand.limits.dexterity
        self._postures[finger] = q
        return np.flatnonzero(ok)

    def _refuse_contact(self, finger: int, direction: int, absent: tuple[int, ...]) -> bool:
        """Note what comes too near while a finger touches along a direction, all others at home but the ``absent`` ones."""
        key = (finger, direction, absent)
        if key not in self._nearest:
            q = self.hand.q_home.copy()
            q[finger] = self._postures[finger][direction]
            self._nearest[key] = self.hand.probe.find_nearest(q, self.X_WO, (finger,), absent)
        return self._note(self._nearest[key])

    def _note(self, nearest: Nearness) -> bool:
        """Return whether bodies are too near to one another, and count that."""
        if nearest.distance >= self.hand.limits.clearance:
            return False
        self.refusals.add(refuse_nearness(nearest, self.hand.limits.clearance))
        return True

    # -- two contacts ----------------------------------------------------------------------------------------------------

    def _find_pair_of(self, i: int, j: int) -> Pair | None:
        hand, limits = self.hand, self.hand.limits
        a, b = self.find_usable(i), self.find_usable(j)
        beta = compute_pair_angle_max(hand.friction.scaled(limits.cone_share)) - limits.closure_margin
        opposite = self._normals[a] @ self._normals[b].T
        one, two = np.nonzero(-opposite > compute_opposition(beta))
        others = tuple(f for f in range(len(hand.fingers)) if f not in (i, j))
        aside = (*(others if self.without is Condition.FINGERS else ()), *self._left_out)
        # The most opposite ones first, then all over; a pose where pairs hold shows that at once.
        order = np.argsort(opposite[one, two], kind="stable")
        spread = np.random.default_rng(0).permutation(order[CHUNK:])[: MOST - CHUNK]
        order = np.concatenate([order[:CHUNK], spread])
        one, two = a[one[order]], b[two[order]]
        for first in range(0, len(one), CHUNK):
            part = slice(first, first + CHUNK)
            if (found := self._try(i, j, one[part], two[part], aside)) is not None:
                return found
        return None

    def _try(
        self, i: int, j: int, one: NDArray[np.intp], two: NDArray[np.intp], aside: tuple[int, ...]
    ) -> Pair | None:
        """Return one of the pairs of directions (N,), (N,) that holds, the least strained."""
        hand = self.hand
        for finger, partner, which in ((i, j, 0), (j, i, 1)):
            rows, back = np.unique((one, two)[which], return_inverse=True)
            refused = [self._refuse_contact(finger, v, (partner, *aside)) for v in rows.tolist()]
            keep = ~np.array(refused, dtype=bool)[back]
            one, two = one[keep], two[keep]
        wrench = compute_object_wrench(hand, None)
        loads = compute_pair_loads(hand, self._normals[one], self._normals[two], wrench).utilisation
        order = np.argsort(loads, kind="stable")
        order = order[loads[order] <= hand.limits.cone_share]
        if len(order) < len(one):
            self.refusals.add(OVERLOAD, len(one) - len(order))
        overloaded = 0
        for k in order[:LOOKED_AT].tolist():
            pair = (i, j, int(one[k]), int(two[k]))
            if self._is_out_of_order(pair) or self._meets(pair, aside):
                continue
            if not self._is_overloaded(pair):
                return pair
            overloaded += 1
            if overloaded == OVERLOADED:
                return None
        return None

    def _is_out_of_order(self, pair: Pair) -> bool:
        i, j, v, w = pair
        normals = {f: p - self._center for f, p in enumerate(self.hand.p_WF_home)}
        if keeps_order(self.hand, {**normals, i: self._normals[v], j: self._normals[w]}):
            return False
        self.refusals.add(OUT_OF_ORDER)
        return True

    def _place(self, pair: Pair) -> Array:
        i, j, v, w = pair
        q = self.hand.q_home.copy()
        q[i], q[j] = self._postures[i][v], self._postures[j][w]
        return q

    def _meets(self, pair: Pair, aside: tuple[int, ...]) -> bool:
        if self.without is Condition.FINGERS:
            return False
        return self._note(self.hand.probe.find_nearest(self._place(pair), self.X_WO, pair[:2], aside))

    def _is_overloaded(self, pair: Pair) -> bool:
        q = self._place(pair)
        states = {f: compute_finger_states(self.hand, f, q[f][None])[0] for f in pair[:2]}
        if not self.admissibility.refuse_load(states, q, self.X_WO):
            return False
        self.refusals.add(OVERLOAD)
        return True


def find_nearest_at_home(
    hand: HandModel, X_WO: Array, finger: int, left_out: tuple[int, ...] = ()
) -> Nearness:
    """Return what is nearest to what while a free finger waits at home, wherever the other fingers are."""
    return hand.probe.find_nearest(hand.q_home, X_WO, (), (*list_others(hand, finger), *left_out))


def explain_no_pair(survey: PairSurvey) -> Refusal:
    """Return what stands in the way of any pair, once ``survey`` has found none.

    Its cure is checked where pairs hold once that is done; there is none where no pair is within reach.
    """
    helping = [condition for condition in Condition if _is_what_is_short(survey, condition)]
    common = survey.refusals.list_common()
    if helping:
        named = [refusal for refusal in common if find_unmet(refusal) in helping]
        refusal = named[0] if named else helping[0].explain(survey.hand)
        return replace(refusal, cure=Cure(", or ".join(helping), is_checked=True))
    if not common:
        return OUT_OF_REACH
    unmet = find_unmet(common[0])
    if unmet is None:
        return common[0]
    return replace(common[0], cure=Cure(f"more than one thing stands in the way: {unmet}, to begin with"))


def _is_what_is_short(survey: PairSurvey, condition: Condition) -> bool:
    """Return whether pairs hold once a condition is left out."""
    met = {find_unmet(refusal) for refusal in survey.refusals.list_common()}
    if condition is Condition.ALLOWED:
        is_asked = bool(survey.hand.object.allowed_regions)
    elif condition in (Condition.JOINTS, Condition.FRICTION):
        is_asked = True
    elif condition is Condition.WEIGHT:
        is_asked = Condition.FRICTION in met
    else:
        is_asked = condition in met and condition not in (Condition.POSTURE, Condition.ORDER)
    if not is_asked:
        return False
    return survey.leave_out(condition).find_pair() is not None


def refuse_every_pair(hand: HandModel, X_WO: Array, admissibility: Admissibility) -> Refusal | None:
    """Return why no two fingers hold the object at ``X_WO`` (4, 4), with a cure; None where some do after all.

    The cure is checked: pairs hold once the condition is left out.  Where none of them alone helps, it belongs to what refuses
    most pairs.
    """
    everyone = tuple(range(len(hand.fingers)))
    alone = hand.probe.find_nearest(hand.q_home, X_WO, (), everyone)
    if alone.distance < (gap := hand.limits.clearance):
        left, kept = spell_apart(1e3 * alone.distance, 1e3 * gap)
        words = f"{alone.names} would come within {left} mm there, and {kept} mm have to be left"
        cure = Cure(Condition.STANDING.value)
        return replace(refuse_nearness(alone, gap), cure=cure, words=words)
    survey = PairSurvey(hand, X_WO, admissibility)
    return None if survey.find_pair() is not None else explain_no_pair(survey)


def spell_no_pair(refusal: Refusal) -> str:
    """Return why no two fingers hold the object, and what may help, in words."""
    if refusal.cure is None:
        return str(refusal)
    if refusal.cure.is_checked:
        return f"{refusal}; what may help: {refusal.cure}"
    return f"{refusal}; {refusal.cure}"
