"""The paper's two theorems against the search: no gait is proposed where Theorem 1 fails, a rewind is found where Theory 3 holds.

Theory 3 speaks of points of contact.  Where fingers take no room the search bears it out; that tips and links do take room is
the only reason for which it finds less.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from dexplan.contact.friction import SoftFinger
from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.aligned import build_aligned
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.contacts.legs import Leg
from dexplan.planning.contacts.oracle import Landfall, Purpose
from dexplan.planning.contacts.orbit_landfalls import find_landings_on
from dexplan.planning.gait.routes import build_routes
from dexplan.planning.gait.search import GaitSearch
from dexplan.planning.gait.steps import Step
from dexplan.planning.gait.theorem_1 import refuse_gait
from dexplan.planning.regions.regions import Regions, compute_regions
from dexplan.planning.regions.sampling import sample_start
from dexplan.planning.regions.theorems import check_theorem_1, check_theory_3
from dexplan.planning.tasks.object_manipulation import plan_rotation
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan
from dexplan.scene.description import Nearness
from dexplan.spatial import Array

UP = np.array([0.0, 0.0, 1.0])
SAFETY = 1.3
BUDGET = 300
Start = tuple[Array | None, ...]


@dataclass(frozen=True)
class Bodiless:
    """Answers for fingers that take no room and weigh nothing."""

    def compute_clearance(
        self, q: Array, X_WO: Array, touching: tuple[int, ...], absent: tuple[int, ...] = ()
    ) -> tuple[float, str]:
        return 1.0, ""

    def find_nearest(
        self, q: Array, X_WO: Array, touching: tuple[int, ...], absent: tuple[int, ...] = ()
    ) -> Nearness:
        return Nearness(1.0, "")

    def find_overlaps(self) -> tuple[Nearness, ...]:
        return ()

    def compute_gravity_torque(self, q: Array) -> Array:
        return np.zeros_like(q)


def with_friction(hand: HandModel, sliding: float) -> HandModel:
    """Return the hand that believes in this friction, less its safety."""
    return replace(hand, friction=SoftFinger(sliding / SAFETY, hand.friction.torsional))


def as_points(hand: HandModel) -> HandModel:
    """Return the paper's fingers: points of contact with what is left of the hand's reach, and hardly anything to carry."""
    return replace(
        hand,
        probe=Bodiless(),
        limits=replace(hand.limits, clearance=-1.0),
        object=hand.object.weighing(1e-6),
        acceleration=1e-6,
    )


def build_table(hand: HandModel, angle: float = 2.0 * np.pi) -> ContactTable:
    return ContactTable(hand, Leg(hand.object.X_WO_home, UP, angle))


def find_regions(hand: HandModel, table: ContactTable) -> Regions:
    """Return the regions with the closure that the planner asks for, its margins included."""
    return compute_regions(hand, hand.object.X_WO_home, theta=table.beta_max)


def pair_of(start: Start) -> tuple[int, int, int]:
    """Return the two fingers that hold, and the free one."""
    i, j = (f for f, x in enumerate(start) if x is not None)
    return i, j, 3 - i - j


def draw_pairs(table: ContactTable, count: int, seed: int) -> list[tuple[Held, Held]]:
    """Return pairs of landings that close the grasp, drawn without asking who could take over."""
    rng, pairs = np.random.default_rng(seed), list[tuple[Held, Held]]()
    for _ in range(100 * count):
        i, j = (int(f) for f in rng.permutation(3)[:2])
        one, two = table.candidates[i], table.candidates[j]
        a = int(rng.integers(len(one.orbit)))
        closed = np.flatnonzero(-(two.normals @ one.normals[a]) > np.cos(2.0 * table.beta_max - 1e-9))
        if len(closed):
            pairs.append((one.pick(i, a), two.pick(j, int(rng.choice(closed)))))
        if len(pairs) == count:
            break
    return pairs


@pytest.mark.parametrize(("sliding", "count"), [(0.14, 200), (0.20, 200), (0.55, 100)])
def test_nobody_lands_where_theorem_1_fails(hand: HandModel, sliding: float, count: int) -> None:
    """Of many grasps: the search's own look for places, theorem not asked, finds none where the theorem fails."""
    table = build_table(with_friction(hand, sliding))
    regions = find_regions(table.hand, table)
    counts = {(met, found): 0 for met in (False, True) for found in (False, True)}
    for pair in draw_pairs(table, count, 4):
        i, j = (h.finger for h in pair)
        k = 3 - i - j
        answer = check_theorem_1(regions, i, j, k, *(table.normal(h) for h in pair))
        asked = [Landfall(k, keep, pair, 0, Purpose.STAND_IN) for keep in pair]
        found = any(find_landings_on(table, asked))
        counts[answer.is_met, found] += 1
        # And the search does ask it, in the same words.
        assert (refuse_gait(table, pair, 0) is None) == answer.is_met
    assert counts[False, True] == 0, counts
    assert sum(counts.values()) == count
    if sliding < 0.5:
        # The condition is no empty word: it fails for some, and is met for more than can be done.
        assert counts[False, False] > 0, counts
        assert counts[True, False] > 0, counts
    else:
        assert counts[True, True] > 0.8 * count, counts


def check_placements(hand: HandModel, plan: Plan) -> int:
    """Return how many fingers a plan places; Theorem 1 holds whenever one is."""
    before, placed = plan.start_contacts, 0
    for action in plan.actions:
        if action.name == "place":
            i, j = action.grasping
            x = [c.normal_O for c in before if c is not None]
            regions = compute_regions(hand, action.X_WO_start)
            assert check_theorem_1(regions, i, j, 3 - i - j, *x).is_met
            placed += 1
        before = action.contacts_end
    return placed


def test_a_start_where_theorem_1_fails_begins_no_gait(hand: HandModel) -> None:
    """Turns beyond what the grasp can do alone, with little friction: no plan, or one that goes elsewhere before it gaits."""
    few = with_friction(hand, 0.20)
    table = build_table(few)
    regions, asked = find_regions(few, table), 0
    for pair in draw_pairs(table, 400, 9):
        i, j = (h.finger for h in pair)
        x = [table.normal(h) for h in pair]
        if check_theorem_1(regions, i, j, 3 - i - j, *x).is_met:
            continue
        start = tuple(dict(zip((i, j), x, strict=True)).get(f) for f in range(3))
        plan = plan_rotation(few, beyond(few, start, 1), start, BUDGET)
        if plan.status.startswith("start_"):
            continue
        asked += 1
        if plan.is_solved:
            first = [a.name for a in plan.actions].index("place")
            assert any(a.name == "move_object" and a.motion.angle for a in plan.actions[:first])
            check_placements(few, plan)
        else:
            assert plan.status == "no_gait"
        if asked == 4:
            break
    assert asked == 4


def beyond(hand: HandModel, start: Start, sense: int) -> RotationGoal:
    """Return the turn that goes two stations farther than the start grasp can by itself."""
    table = build_table(hand, sense * 2.0 * np.pi)
    held = [table.start_along(f, x) for f, x in enumerate(start) if x is not None]
    reach = min(h.left for h in held if h is not None)
    return RotationGoal(hand.object.X_WO_home, UP, sense * np.radians(2.0 * (reach + 2)))


def draw_doubles(hand: HandModel, count: int, seed: int) -> list[Start]:
    """Return starts with both contacts in their double regions, where Theory 3 is met: its own witnesses, and ``count`` drawn."""
    table = build_table(hand)
    regions, rng = find_regions(hand, table), np.random.default_rng(seed)
    starts: list[Start] = []
    answer = check_theory_3(regions, 0, 1, 2)
    assert answer.is_met, answer.reason
    starts.append((answer.x_O, answer.y_O, None))
    assert all(check_theory_3(regions, i, j, 3 - i - j).is_met for i, j in ((0, 2), (1, 2)))
    for _ in range(60):
        if len(starts) == 1 + count:
            break
        start = sample_start(hand, rng)
        i, j, k = pair_of(start)
        x, y = start[i], start[j]
        assert x is not None
        assert y is not None
        inside = regions.double(i, j, k).contains(x) and regions.double(j, i, k).contains(y)
        held = [table.start_along(f, n) for f, n in ((i, x), (j, y))]
        if inside and all(held) and -x @ y > np.cos(2.0 * regions.theta):
            starts.append(start)
    return starts


def has_room(hand: HandModel, start: Start) -> bool:
    """Return whether the third tip fits anywhere beside the two that hold, so that it closes the grasp with one of them.

    Looks at 12 000 directions: tips as balls on a ball, what the finger can touch, the order of fingers.  No search.
    """
    table = build_table(hand)
    regions = find_regions(hand, table)
    k = pair_of(start)[2]
    n = spread_directions(12_000)
    n = n[regions.contactable[k].contains(n)]
    held = {f: x for f, x in enumerate(start) if x is not None}
    closes = np.logical_or(*(-(n @ x) > np.cos(2.0 * regions.theta) for x in held.values()))
    fits = table.keep_order({**held, k: n})
    tips = build_aligned(hand, k, np.zeros(3), n)[:, :3, 3]
    for f, x in held.items():
        other = build_aligned(hand, f, np.zeros(3), x[None])[0, :3, 3]
        radii = hand.fingers[f].tip_radius + hand.fingers[k].tip_radius
        fits &= np.linalg.norm(tips - other, axis=1) - radii > hand.limits.clearance
    return bool((closes & fits).any())


def rewind(hand: HandModel, goal: RotationGoal, start: Start) -> list[Step]:
    """Return a gait to the goal in which the start pair alone moves the object; [] where none is found.

    The planner itself would let any one pair move it, the first exchange coming before the first move; here it has to be this
    pair, as Theory 3 says, so that its fingers have to be placed anew.
    """
    search = GaitSearch(hand, build_routes(goal)[0], Admissibility(hand), ("rewind",))
    held = [search.tables[0].start_along(f, x) for f, x in enumerate(start) if x is not None]
    search.begin(tuple(h for h in held if h is not None), movers=pair_of(start)[:2])
    node = search.run(BUDGET)
    return [] if node is None else search.steps(node)


def check_rewind(steps: list[Step], start: Start) -> None:
    """One pair moves the object, before and after its fingers were placed anew while the third held with one of them."""
    i, j, k = pair_of(start)
    placed = [s.placed.finger for s in steps if s.placed is not None]
    assert k in placed
    assert {i, j} & set(placed)
    for step in steps:
        if abs(step.angle) > 1e-9:
            assert {c.finger for c in step.contacts} == {i, j}


@pytest.mark.parametrize(("sliding", "drawn"), [(0.55, 1), (0.40, 1), (0.20, 0)])
def test_points_of_contact_are_rewound_where_theory_3_holds(
    hand: HandModel, sliding: float, drawn: int
) -> None:
    """For every such start, and a turn just beyond its own reach: this very pair is rewound."""
    points = as_points(with_friction(hand, sliding))
    starts = draw_doubles(points, drawn, 8)
    for number, start in enumerate(starts):
        steps = rewind(points, beyond(points, start, 1 if number % 2 else -1), start)
        assert steps, (number, start)
        check_rewind(steps, start)


def test_real_tips_are_rewound_unless_there_is_no_room_for_them(hand: HandModel) -> None:
    """At 0.40, where many starts that Theory 3 is content with leave no gap for a third tip: found, or truly no room."""
    real = with_friction(hand, 0.40)
    counts = {"found": 0, "no room": 0, "in the way": 0}
    for start in draw_doubles(real, 2, 8):
        steps = rewind(real, beyond(real, start, 1), start)
        if steps:
            check_rewind(steps, start)
            counts["found"] += 1
        elif has_room(real, start):
            counts["in the way"] += 1
        else:
            counts["no room"] += 1
    assert counts["found"] > 0, counts
    assert counts["no room"] > 0, counts
