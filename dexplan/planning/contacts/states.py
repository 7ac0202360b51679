"""Is a grasp admissible while it goes along a leg?  Quick answers for the search, exact ones for what it settles on.

``Admissibility`` is the judge.  Loads of pairs, most of its work, are first looked at for whole runs at once: forces that balance
the load well inside the believed cones prove that the judge will find some, and a cone exceeded by the best of them that it will
not.  Only what lies between is asked right away; every state of a finished plan is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dexplan.kinematics.arcs import build_travel, compute_hover
from dexplan.planning.admissible.admissibility import Admissibility, Margins
from dexplan.planning.admissible.conditions import refuse_nearness
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.loads import compute_contact_torques, compute_pair_loads, sure_share
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.ways.detour import Surroundings
from dexplan.planning.ways.travel import Way, find_way
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.scene.description import Nearness
from dexplan.spatial import Array, make_pose

SURE, UNKNOWN, NEVER = 1, 0, -1
_SLACK = 1.02
"""The quick answer searches on a grid: a cone is exceeded for sure only by this factor."""
_SAMPLE = 5
"""A finger's own weight is computed at one of so many stations."""
MOST_FAILED_DETOURS = 12
"""So many detours are looked for in vain while one goal is planned for; after that what is in the way of an arc is believed."""
OVERLOAD = Refusal(RefusalKind.LOAD, words="the contacts cannot carry the load (friction)")


class Where(NamedTuple):
    """What decides a contact's posture: its orbit, where it landed (hence its spin), and how far it came."""

    orbit: int
    landed: int
    steps: int

    @classmethod
    def of(cls, held: Held) -> Where:
        """Return where a contact is."""
        return cls(held.orbit, held.landed, held.steps)


Key = tuple[Where, ...]


class StateChecks:
    """Checks grasps of one leg's ``table``, each state once."""

    def __init__(self, table: ContactTable, admissibility: Admissibility) -> None:
        self._table, self._admissibility = table, admissibility
        self._hand: HandModel = table.hand
        self._exact: dict[Key, Margins] = {}
        self._refusal: dict[Key, Refusal | None] = {}
        self._together: dict[Key, Refusal | None] = {}
        self._loads: dict[Key, NDArray[np.int8]] = {}
        self._bias: dict[tuple[int, int], Array] = {}
        self._arcs: dict[Where, Array] = {}
        self._ways: dict[tuple[Where, Key, bool], Way] = {}

    @property
    def count(self) -> int:
        """Number of states looked at."""
        return len(self._refusal | self._exact)

    def judge(self, held: tuple[Held, ...], explain: bool = True) -> Margins:
        """Return the margins of holding the object with ``held``, all other fingers at home: the exact answer.

        ``explain`` says whether a refusal for the load has to name what is short.
        """
        key = _key(held)
        if key not in self._exact:
            q = self._postures(held)
            states = {h.finger: self._table.state(h) for h in held}
            # A sphere is the same at any progress, so one check serves all.
            pose = make_pose(p=self._table.center(held[0]))
            row = self._admissibility.compute_margins_of(
                states, q, pose, axis_W=self._table.axis_W, explain=explain
            )
            self._exact[key] = row
            self._refusal[key] = row.refusal
        return self._exact[key]

    def refuse(self, held: tuple[Held, ...]) -> Refusal | None:
        """Return why the object cannot be held with ``held``, all other fingers at home; None where it can: the quick answer."""
        key = _key(held)
        if key not in self._refusal:
            self._refusal[key] = self._look(held)
        return self._refusal[key]

    def _look(self, held: tuple[Held, ...]) -> Refusal | None:
        if len(held) != 2:
            return self.judge(held, explain=False).refusal
        offset = min(h.steps for h in held)
        start = tuple(h.carried(-offset) for h in held)
        verdict = self._assess(start)[offset]
        if verdict == NEVER:
            return OVERLOAD
        limits = self._hand.limits
        for h in held:
            state = self._table.state(h)
            if state.joint < limits.joint_margin or state.dexterity < limits.dexterity:
                return self.judge(held, explain=False).refusal
        nearest = self._hand.probe.find_nearest(
            self._postures(held), make_pose(p=self._table.center(held[0])), tuple(h.finger for h in held)
        )
        if nearest.distance < limits.clearance:
            return refuse_nearness(nearest, limits.clearance)
        return None if verdict == SURE else self.judge(held, explain=False).refusal

    def _assess(self, start: tuple[Held, ...]) -> NDArray[np.int8]:
        """Return for all stations that a pair could go through whether it carries the load there."""
        key = _key(start)
        if key in self._loads:
            return self._loads[key]
        table, hand, limits = self._table, self._hand, self._hand.limits
        a, b = sorted(start, key=lambda h: h.finger)
        count = min(a.left, b.left, table.stations) + 1
        normals = [table.normals_ahead(h, count) for h in (a, b)]
        loads = compute_pair_loads(hand, normals[0], normals[1], table.wrench)
        verdict = np.where(loads.utilisation <= sure_share(hand), SURE, UNKNOWN)
        verdict[loads.utilisation > _SLACK * limits.cone_share] = NEVER
        for c, h in enumerate((a, b)):
            states = table.states_ahead(h, count)
            J = np.stack([s.J for s in states])
            offset = -hand.fingers[h.finger].tip_radius * normals[c]
            torque = compute_contact_torques(J, offset, loads.forces[:, c], loads.torsions[:, c], normals[c])
            torque += self._gravity(h)[h.steps : h.steps + count]
            strained = (np.abs(torque) > limits.torque_share * hand.fingers[h.finger].torque_limit).any(1)
            verdict[strained & (verdict == SURE)] = UNKNOWN
        self._loads[key] = verdict.astype(np.int8)
        return self._loads[key]

    def _gravity(self, held: Held) -> Array:
        """Return the joint torques (run, J) that hold the finger's own weight along its run, interpolated between samples."""
        key = (held.orbit, held.landed)
        if key not in self._bias:
            states = self._table.states_ahead(held.carried(-held.steps), held.steps + held.left + 1)
            sampled = sorted({*range(0, len(states), _SAMPLE), len(states) - 1})
            q, rows = self._hand.q_home.copy(), []
            for k in sampled:
                q[held.finger] = states[k].q
                rows.append(self._hand.probe.compute_gravity_torque(q)[held.finger])
            every = np.arange(len(states))
            self._bias[key] = np.stack(
                [np.interp(every, sampled, column) for column in np.array(rows).T], axis=1
            )
        return self._bias[key]

    def _postures(self, held: tuple[Held, ...]) -> Array:
        q = self._hand.q_home.copy()
        for h in held:
            q[h.finger] = self._table.state(h).q
        return q

    # -- exchanges of fingers --------------------------------------------------------------------------------------------

    def refuse_together(self, held: tuple[Held, ...]) -> Refusal | None:
        """Return why not all of ``held`` can touch and bear the object at rest; None if they can."""
        key = _key(held)
        if key not in self._together:
            states = {h.finger: self._table.state(h) for h in held}
            pose = make_pose(p=self._table.center(held[0]))
            row = self._admissibility.compute_margins_of(states, self._postures(held), pose, explain=False)
            self._together[key] = row.refusal
        return self._together[key]

    def clear_of(self, held: tuple[Held, ...], done: int) -> Nearness:
        """Return what is nearest to what while all of ``held`` touch."""
        return self._hand.probe.find_nearest(
            self._postures(held), self._table.leg.pose(done), tuple(h.finger for h in held)
        )

    def find_way(self, moving: Held, holding: tuple[Held, ...], done: int, looks_around: bool) -> Way:
        """Return how a finger goes between its home and its hover over a contact while ``holding`` hold.

        The rest of the way is along the normal.  It is the arc, where that is clear or unless it ``looks_around``.
        """
        key = Where.of(moving), _key(holding), looks_around
        if key not in self._ways:
            X_WO, finger = self._table.leg.pose(done), self._hand.fingers[moving.finger]
            arc = self._arcs.get(Where.of(moving))
            if arc is None:
                placement = self._table.placement(moving, done)
                hover = compute_hover(
                    finger, X_WO, placement.X_OF, placement.normal_O, placement.q, self._hand.hover
                )
                arc = self._arcs[Where.of(moving)] = build_travel(finger, finger.q_home, hover, X_WO[:3, 3])
            around = self._around(moving, holding, done)
            way = find_way(
                around, arc, looks_around and self._admissibility.failed_detours < MOST_FAILED_DETOURS
            )
            if looks_around and not way.around and way.clearance < self._hand.limits.clearance:
                self._admissibility.failed_detours += 1
            self._ways[key] = way
        return self._ways[key]

    def may_go_around(self, way: Way, moving: Held, holding: tuple[Held, ...], done: int) -> bool:
        """Return whether a way is not clear though its ends are: then there may be a detour."""
        limit = self._hand.limits.clearance
        if way.around or way.clearance >= limit:
            return False
        return self._around(moving, holding, done).compute_way_clearance(way.postures[[0, -1]])[0] >= limit

    def _around(self, moving: Held, holding: tuple[Held, ...], done: int) -> Surroundings:
        fingers = tuple(h.finger for h in holding)
        pose = self._table.leg.pose(done)
        return Surroundings(self._hand, self._postures(holding), pose, moving.finger, fingers)


def _key(held: tuple[Held, ...]) -> Key:
    return tuple(sorted(Where.of(h) for h in held))
