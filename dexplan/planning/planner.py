"""The search: which finger lifts, where and with which spin it lands, how far the object turns in between.

Best first over grasps.  A node is a progress of the turn and a pair of contacts that hold the object there; its children turn
the object with that pair as far as it goes (or a little less), put a free finger down so that it holds with one of the two,
and lift the other: finger substitution [paper §2.2].  Everything a node promises is checked only when the search wants to go
through it.  Nothing here knows how many fingers there are, where they stand, or what the axis is.
"""

from __future__ import annotations

import heapq
import re
from dataclasses import dataclass, field

import numpy as np

from dexplan.planning.admissible import Admissibility, FingerState, Margins, compute_finger_states, worst
from dexplan.planning.gaits import Step, build_actions
from dexplan.planning.goal import RotationGoal
from dexplan.planning.hand import HandModel
from dexplan.planning.orbits import STEP, Orbit, build_orbits, carried_posture
from dexplan.planning.plan import SOLVED, Action, Placement, Plan
from dexplan.planning.regions import compute_pair_angle_max, keeps_order
from dexplan.planning.travel import build_travel, compute_hover
from dexplan.spatial import Array, build_frame, invert_pose, make_pose, rotate_about

POLAR_SPACING = float(np.radians(5.0))
SPREAD = 6
"""Placements tried per finger and partner."""
TURNS = (1.0, 0.9, 0.8, 0.65, 0.5, 0.3)
"""Shares of the longest possible turn after which a substitution is tried."""
STRIDE = 4
"""While searching, motions are checked at every so many stations."""
GREED = 3.0
"""How much more a turn still to be made counts than placements already spent.  One placement is taken to be worth half of what
a finger can carry a contact; above 1 the search looks for a good gait soon rather than for the best one at last."""


@dataclass(frozen=True)
class Held:
    """A contact as the search knows it: a finger on an orbit, where it landed, how far it has been carried and can still be."""

    finger: int
    orbit: int
    landed: int
    steps: int
    left: int


@dataclass(order=True)
class _Entry:
    priority: float
    serial: int
    node: _Node = field(compare=False)


@dataclass(eq=False)
class _Node:
    """Progress ``done`` [stations], the contacts that hold, and how the search came here."""

    done: int
    held: tuple[Held, ...]
    placements: int
    parent: _Node | None = None
    moved: int = 0
    placed: Held | None = None
    lifted: Held | None = None
    reach: int | None = None
    limit: tuple[int | None, str] = (None, "")
    margins: dict[str, float] = field(default_factory=dict)
    place_margins: dict[str, float] = field(default_factory=dict)


class GaitSearch:
    """Searches a gait that turns the object by ``goal.angle`` about ``goal.axis_W``."""

    def __init__(self, hand: HandModel, goal: RotationGoal, node_budget: int) -> None:
        self._hand, self._goal, self._budget = hand, goal, node_budget
        self._sense = 1 if goal.angle >= 0.0 else -1
        self._stations = int(np.ceil(abs(goal.angle) / STEP - 1e-9))
        self._admissibility = Admissibility(hand)
        self._frame = build_frame(goal.axis_W)
        self._beta_max = compute_pair_angle_max(hand.friction.scaled(hand.limits.cone_share))
        self._orbits: list[Orbit] = []
        self._by_finger: dict[int, list[int]] = {}
        self._candidates: dict[int, tuple[Array, Array, Array, Array]] = {}
        self._memo: dict[tuple[tuple[int, int, int], ...], Margins] = {}
        self._runs: dict[tuple[int, int], list[FingerState]] = {}
        self._ways: dict[tuple[int, int, int], Array] = {}
        self.expanded = 0
        self.checked = 0
        self._refusals: dict[str, int] = {}

    # -- tables ----------------------------------------------------------------------------------------------------------

    def prepare(self, start: tuple[Array | None, ...]) -> list[Held | None]:
        """Build the orbits; return each start contact (outward normal (3,) in W, or None) as the search knows it."""
        n = len(self._hand.fingers)
        polars = np.arange(POLAR_SPACING, np.pi - 1e-6, POLAR_SPACING)
        wanted = [(f, float(p), 0.0) for f in range(n) for p in polars]
        special: dict[int, tuple[float, float]] = {}
        for finger, normal in enumerate(start):
            if normal is not None:
                local = self._frame.T @ normal
                special[finger] = (float(np.arccos(np.clip(local[2], -1, 1))), float(np.arctan2(local[1], local[0])))
                wanted.append((finger, *special[finger]))
        center = self._goal.X_WO_start[:3, 3]
        self._orbits = build_orbits(self._hand, self._goal.axis_W, center, self._sense, wanted)
        for index, orbit in enumerate(self._orbits):
            self._by_finger.setdefault(orbit.finger, []).append(index)
        held: list[Held | None] = [None] * n
        for finger in special:
            own = self._by_finger[finger].pop()  # the start's own orbit comes last and is nobody's landing place
            orbit = self._orbits[own]
            if orbit.is_reached[0]:
                held[finger] = Held(finger, own, 0, 0, int(orbit.carry[0]))
        for finger, indices in self._by_finger.items():
            rows = [(i, int(k)) for i in indices for k in np.flatnonzero(self._orbits[i].is_reached)]
            index = np.array([r[0] for r in rows], dtype=np.intp)
            station = np.array([r[1] for r in rows], dtype=np.intp)
            normals = np.array([self._orbits[i].normals[k] for i, k in rows]).reshape(-1, 3)
            carry = np.array([self._orbits[i].carry[k] for i, k in rows], dtype=np.intp)
            self._candidates[finger] = (index, station, normals, carry)
        return held

    def normal(self, held: Held) -> Array:
        """Return the outward normal (3,) in W of a contact where it is now."""
        orbit = self._orbits[held.orbit]
        return orbit.normals[(held.landed + self._sense * held.steps) % len(orbit.normals)]

    def posture(self, held: Held) -> Array:
        """Return the finger's posture (J,) where the contact is now."""
        return self._state(held).q

    def object_pose(self, done: int) -> Array:
        """Return the object's pose (4, 4) after ``done`` stations of the turn; the last station ends at the goal exactly."""
        angle = self._sense * min(done * STEP, abs(self._goal.angle))
        X = self._goal.X_WO_start.copy()
        X[:3, :3] = rotate_about(self._goal.axis_W, angle) @ X[:3, :3]
        return X

    def placement(self, held: Held, done: int) -> Placement:
        """Return the contact as a plan's value, with the object at progress ``done``."""
        X_WO, hand = self.object_pose(done), self._hand
        q = self.posture(held)
        X_WF = hand.fingers[held.finger].pose_at(q)
        normal_O = X_WO[:3, :3].T @ self.normal(held)
        return Placement(held.finger, hand.object.surface.closest(normal_O), normal_O, invert_pose(X_WO) @ X_WF, q)

    # -- checks ----------------------------------------------------------------------------------------------------------

    def margins(self, held: tuple[Held, ...]) -> Margins:
        """Return the margins of holding the object with ``held``, all other fingers at home."""
        key = tuple(sorted(self._where(h) for h in held))
        if key not in self._memo:
            q = self._hand.q_home
            states = {h.finger: self._state(h) for h in held}
            for finger, state in states.items():
                q[finger] = state.q
            self.checked += 1
            # A sphere is the same at any progress, so one check serves all.
            pose = make_pose(np.eye(3), self._goal.X_WO_start[:3, 3])
            axis = self._sense * self._goal.axis_W
            self._memo[key] = self._admissibility.compute_margins_of(states, q, pose, axis_W=axis)
        return self._memo[key]

    def _where(self, held: Held) -> tuple[int, int, int]:
        """Return what decides a contact's posture: its orbit, where it landed (hence its spin), and where it is."""
        return held.orbit, held.landed, held.steps

    def _state(self, held: Held) -> FingerState:
        """Return the finger's state; a whole run is computed at once when first asked for."""
        run = self._runs.get((held.orbit, held.landed))
        if run is None:
            orbit = self._orbits[held.orbit]
            stations = range(int(orbit.carry[held.landed]) + 1)
            q = np.stack([carried_posture(self._hand, orbit, held.landed, k, self._sense) for k in stations])
            run = self._runs[held.orbit, held.landed] = compute_finger_states(self._hand, held.finger, q)
        return run[held.steps]

    def _walk(self, node: _Node) -> int:
        """Return how many stations the node's grasp can turn the object (-1: it cannot hold it), and note what ends it.

        While searching every ``STRIDE``-th station is checked, and the last; the way that is found is checked at all of them.
        """
        limiter = min(node.held, key=lambda h: h.left)
        furthest = min(limiter.left, self._stations - node.done)
        last = -1
        for k in sorted({*range(0, furthest, STRIDE), furthest}):
            row = self.margins(tuple(_carry(h, k) for h in node.held))
            if not row.is_admissible:
                node.limit = (None, row.refusal)
                return last
            last = k
        if furthest == limiter.left:
            node.limit = (limiter.finger, self._orbits[limiter.orbit].limit[limiter.landed])
        else:
            node.limit = (None, "the goal")
        return furthest

    def _check_finely(self, goal: _Node) -> str:
        """Check every station of the way to ``goal``; note the margins and return the first refusal, "" if there is none."""
        way = _trace_back(goal)
        for here, turn in zip(way, self._turns(way), strict=True):
            rows = [self.margins(tuple(_carry(h, k) for h in here.held)) for k in range(turn + 1)]
            here.margins = worst(rows)
            refused = next((row.refusal for row in rows if not row.is_admissible), "")
            if refused:
                return refused
        return ""

    def _turns(self, way: list[_Node]) -> list[int]:
        """Return the stations turned with the grasp of each node of a way, the last one turning to the goal."""
        return [*(n.moved for n in way[1:]), self._stations - way[-1].done]

    def _check_arrival(self, node: _Node) -> str:
        """Return why the substitution that leads to ``node`` cannot be done, "" if it can."""
        assert node.lifted is not None
        before = (*(h for h in node.held if h is not node.placed), node.lifted)
        pair = self.margins(node.held)
        if not pair.is_admissible:
            return pair.refusal
        q = self._hand.q_home
        for h in before:
            q[h.finger] = self.posture(h)
        X_WO = self.object_pose(node.done)
        clearances = []
        if node.placed is not None:
            clearances.append(self._check_way(q, X_WO, node.placed, tuple(h.finger for h in before), node.done))
            q[node.placed.finger] = self.posture(node.placed)
            everyone = tuple(h.finger for h in (*before, node.placed))
            clearances.append(self._hand.probe.compute_clearance(q, X_WO, everyone))
        clearances.append(self._check_way(q, X_WO, node.lifted, tuple(h.finger for h in node.held), node.done))
        least, names = min(clearances)
        node.place_margins = {**pair.as_dict(), "clearance_mm": 1e3 * min(least, pair.clearance)}
        if least < self._hand.limits.clearance:
            return f"{names} come within {1e3 * least:.1f} mm on the way"
        return ""

    def _check_way(
        self, q: Array, X_WO: Array, held: Held, holding: tuple[int, ...], done: int
    ) -> tuple[float, str]:
        """Return the clearance between a finger's home and its hover over ``held``; the approach itself is along the normal."""
        path = self._ways.get(self._where(held))
        if path is None:
            hand, finger, placement = self._hand, self._hand.fingers[held.finger], self.placement(held, done)
            hover = compute_hover(finger, X_WO, placement.X_OF, placement.normal_O, placement.q, hand.hover)
            path = build_travel(finger, finger.q_home, hover, X_WO[:3, 3])[::2]
            self._ways[self._where(held)] = path
        return self._admissibility.compute_path_clearance(q, X_WO, held.finger, path, holding)

    # -- search ----------------------------------------------------------------------------------------------------------

    def run(self, starts: list[tuple[Held, ...]]) -> tuple[_Node | None, str, str]:
        """Search from the given grasps; return the goal node, or None with a status and why."""
        heap: list[_Entry] = []
        serial = 0
        runs = [np.percentile(c[3], 90) for c in self._candidates.values() if len(c[3])]
        worth = max(1.0, 0.5 * float(np.mean(runs))) if runs else 1.0
        for held in starts:
            heap.append(_Entry(self._rank(0, held, 0, worth), serial, _Node(0, held, 0)))
            serial += 1
        heapq.heapify(heap)
        seen: set[tuple[object, ...]] = set()
        budget_left = True
        while heap:
            node = heapq.heappop(heap).node
            key = (node.done // 2, frozenset((h.finger, h.orbit, (h.landed + self._sense * h.steps) // 2) for h in node.held))
            if key in seen:
                continue
            if node.lifted is not None:
                refusal = self._check_arrival(node)
                if refusal:
                    self._refuse(refusal)
                    continue
            seen.add(key)
            self.expanded += 1
            if self.expanded > self._budget:
                budget_left = False
                break
            node.reach = reach = self._walk(node)
            if reach < 0:
                self._refuse(node.limit[1])
                continue
            if node.done + reach >= self._stations:
                refusal = self._check_finely(node)
                if not refusal:
                    return node, SOLVED, ""
                self._refuse(refusal)
                continue
            for child in self._children(node, reach):
                heapq.heappush(heap, _Entry(self._rank(child.done, child.held, child.placements, worth), serial, child))
                serial += 1
        common = sorted(self._refusals.items(), key=lambda item: (-item[1], item[0]))[:2]
        refusals = "; ".join(text for text, _ in common) or "no placement forms an admissible grasp with a holding finger"
        if not budget_left:
            return None, "budget_exhausted", f"no gait within {self._budget} nodes ({refusals}); raise gait.node_budget"
        return None, "no_gait", f"{refusals}; {_CURE}"

    def _refuse(self, refusal: str) -> None:
        """Count a refusal; distances differ from state to state, so they are left out of the text."""
        text = re.sub(r" within -?[0-9.]+ mm", "", refusal)
        self._refusals[text] = self._refusals.get(text, 0) + 1

    def _rank(self, done: int, held: tuple[Held, ...], placements: int, worth: float) -> float:
        # A turn ends when one contact is used up; what the other has left then serves the next turn, about half of it.
        promised = min(self._stations, done + float(np.mean([h.left for h in held])))
        # Between equals, prefer contacts near opposite: small forces and room for error.
        slack = 2.0 * self._beta(held) / self._beta_max
        return placements + GREED * (self._stations - promised) / worth + 0.3 * slack

    def _children(self, node: _Node, reach: int) -> list[_Node]:
        children = []
        turns = sorted({round(share * reach) for share in TURNS}, reverse=True)
        for turn in turns:
            held = tuple(_carry(h, turn) for h in node.held)
            if len(held) > 2:
                children.extend(self._release(node, turn, held))
            taken = {h.finger for h in held}
            for finger in self._candidates:
                if finger in taken:
                    continue
                for keep in held if len(held) == 2 else ():
                    drop = tuple(h for h in held if h is not keep)
                    for landing in self._landings(finger, keep, held):
                        child = _Node(
                            node.done + turn, (keep, landing), node.placements + 1, node, turn, landing, drop[0]
                        )
                        children.append(child)
        return children

    def _release(self, node: _Node, turn: int, held: tuple[Held, ...]) -> list[_Node]:
        """Return the children that lift one of more than two fingers and hold on with the others."""
        groups = [(h, tuple(other for other in held if other is not h)) for h in held]
        return [
            _Node(node.done + turn, rest, node.placements, node, turn, None, lifted)
            for lifted, rest in groups
            if self.has_pair(rest)
        ]

    def _landings(self, finger: int, keep: Held, held: tuple[Held, ...]) -> list[Held]:
        """Return the most promising placements of a free ``finger`` that hold with ``keep`` and clear everyone."""
        index, station, normals, carry = self._candidates[finger]
        if not len(index):
            return []
        hand = self._hand
        beta = 0.5 * np.arccos(np.clip(normals @ -self.normal(keep), -1.0, 1.0))
        ok = beta < self._beta_max
        for h in held:
            gap = hand.fingers[finger].tip_radius + hand.fingers[h.finger].tip_radius + hand.limits.clearance
            tip = self._tip(h.finger, self.normal(h))
            tips = self._tip(finger, normals)
            ok &= np.linalg.norm(tips - tip, axis=1) > gap
        promise = np.minimum(carry, keep.left)
        ok &= promise > 0
        rows = np.flatnonzero(ok)
        if not len(rows):
            return []
        score = promise[rows] / max(1, int(promise[rows].max())) - 0.3 * beta[rows] / self._beta_max
        order = rows[np.argsort(-score, kind="stable")]
        chosen: list[Held] = []
        normals_held = {h.finger: self.normal(h) for h in held}
        for row in order:
            if any(normals[row] @ self.normal(c) > np.cos(np.radians(8.0)) for c in chosen):
                continue  # a neighbour of one already chosen has nothing new to say
            if not keeps_order(hand, {**normals_held, finger: normals[row]}):
                continue
            chosen.append(Held(finger, int(index[row]), int(station[row]), 0, int(carry[row])))
            if len(chosen) == SPREAD:
                break
        return chosen

    def _tip(self, finger: int, normals: Array) -> Array:
        radius = self._hand.fingers[finger].tip_radius
        return self._hand.object.surface.closest(normals) + radius * normals

    def has_pair(self, held: tuple[Held, ...]) -> bool:
        """Return whether two of the contacts are force closed with the believed friction."""
        return self._beta(held) < self._beta_max

    def needed_angle(self) -> str:
        """Return in words what two contacts need for force closure."""
        angle = np.degrees(np.pi - 2.0 * self._beta_max)
        return f"{angle:.1f} deg or more apart, as force closure with the believed friction needs"

    def _beta(self, held: tuple[Held, ...]) -> float:
        """Return the smallest angle [rad] between normals and chord over the pairs of contacts."""
        normals = np.stack([self.normal(h) for h in held])
        opposite = -(normals @ normals.T)[np.triu_indices(len(held), 1)]
        return 0.5 * float(np.arccos(np.clip(opposite.max(), -1.0, 1.0)))

    def automatic_pairs(self, count: int = 24) -> list[tuple[Held, ...]]:
        """Return pairs to start from where the problem leaves it to the planner: long runs, nearly opposite contacts."""
        found: list[tuple[float, tuple[Held, ...]]] = []
        fingers = sorted(self._candidates)
        for a, first in enumerate(fingers):
            index, station, normals, carry = self._candidates[first]
            for row in range(0, len(index), max(1, len(index) // 160)):
                h = Held(first, int(index[row]), int(station[row]), 0, int(carry[row]))
                for second in fingers[a + 1 :]:
                    for other in self._landings(second, h, (h,))[:2]:
                        pair = (h, other)
                        promise = min(min(h.left, other.left), self._stations)
                        found.append((promise - 8.0 * self._beta(pair) / self._beta_max, pair))
        found.sort(key=lambda item: -item[0])
        return [pair for _, pair in found[:count]]

    # -- answer ----------------------------------------------------------------------------------------------------------

    def steps(self, node: _Node) -> list[Step]:
        """Return the way to ``node`` and on to the goal as symbolic steps."""
        chain = _trace_back(node)
        turns = self._turns(chain)
        steps: list[Step] = []
        for k, here in enumerate(chain):
            turn = turns[k]
            contacts = tuple(self.placement(h, here.done) for h in here.held)
            placed = None if here.placed is None else self.placement(here.placed, here.done)
            lifted = None if here.lifted is None else here.lifted.finger
            steps.append(
                Step(
                    contacts=contacts,
                    X_WO_start=self.object_pose(here.done),
                    X_WO_end=self.object_pose(here.done + turn),
                    angle=self._sense
                    * (min((here.done + turn) * STEP, abs(self._goal.angle)) - min(here.done * STEP, abs(self._goal.angle))),
                    placed=placed,
                    lifted=lifted,
                    limit=here.limit if turn == here.reach else (None, "a shorter turn leaves the better next grasp"),
                    margins=here.margins,
                    place_margins=here.place_margins,
                )
            )
        return steps


_CURE = "raise the friction, lower friction.safety, or use a lighter object"


def _trace_back(node: _Node) -> list[_Node]:
    """Return the nodes from the start to ``node``."""
    way = [node]
    while way[-1].parent is not None:
        way.append(way[-1].parent)
    return way[::-1]


def _carry(held: Held, steps: int) -> Held:
    return Held(held.finger, held.orbit, held.landed, held.steps + steps, held.left - steps)


def refuse(
    hand: HandModel, goal: RotationGoal, status: str, reason: str, contacts: tuple[Placement | None, ...] | None = None
) -> Plan:
    """Return the plan that says why there is none."""
    nothing: tuple[Placement | None, ...] = (None,) * len(hand.fingers)
    return _answer(hand, goal, status, reason, contacts or nothing, (), {})


def _answer(
    hand: HandModel,
    goal: RotationGoal,
    status: str,
    reason: str,
    contacts: tuple[Placement | None, ...],
    actions: tuple[Action, ...],
    statistics: dict[str, float],
) -> Plan:
    return Plan(
        status=status,
        reason=reason,
        fingers=tuple(f.name for f in hand.fingers),
        goal_kind="object_manipulation",
        X_WO_start=goal.X_WO_start,
        X_WO_goal=goal.X_WO_goal,
        axis_W=goal.axis_W,
        turned_angle=goal.angle,
        start_contacts=contacts,
        actions=actions,
        normal_force=hand.normal_force,
        statistics=statistics,
    )


def plan_rotation(
    hand: HandModel, goal: RotationGoal, start: tuple[Array | None, ...] | None, node_budget: int
) -> Plan:
    """Return a plan that turns the object by ``goal.angle`` about ``goal.axis_W`` with finger substitution.

    ``start`` holds the outward normals (3,) in W where the fingers touch at first, None for a free finger; or is None where
    the planner may choose.  No plan is an answer with a status, not an exception.
    """
    search = GaitSearch(hand, goal, node_budget)
    held = search.prepare(start if start is not None else (None,) * len(hand.fingers))
    contacts: tuple[Placement | None, ...] = (None,) * len(hand.fingers)
    if start is None:
        grasps = search.automatic_pairs()
        if not grasps:
            return refuse(hand, goal, "no_force_closure_pair", f"no two fingers reach contacts {search.needed_angle()}; {_CURE}")
    else:
        for finger, normal in enumerate(start):
            if normal is not None and held[finger] is None:
                return refuse(
                    hand,
                    goal,
                    "start_unreachable",
                    f"{hand.fingers[finger].name} cannot hold its start contact: it lies outside the finger's workspace or against "
                    'a joint limit; move the contact towards the finger, or set start.contacts_deg = "auto"',
                )
        contacts = tuple(None if h is None else search.placement(h, 0) for h in held)
        touching = tuple(h for h in held if h is not None)
        grasps = [touching]
        if not search.has_pair(touching):
            return refuse(
                hand,
                goal,
                "no_admissible_pair",
                f"no two of the start contacts are {search.needed_angle()}, so no finger can be lifted; the plan would have to "
                f"begin with rolling, which is not built yet; move two contacts apart, or {_CURE}",
                contacts,
            )
    node, status, why = search.run(grasps)
    statistics = {"nodes": search.expanded, "states_checked": search.checked}
    if node is None:
        return _answer(hand, goal, status, why, contacts, (), statistics)
    steps = search.steps(node)
    first: list[Placement | None] = [None] * len(hand.fingers)
    for placement in steps[0].contacts:
        first[placement.finger] = placement
    actions = build_actions(steps, tuple(first), goal.axis_W)
    return _answer(hand, goal, SOLVED, "", tuple(first), actions, statistics)
