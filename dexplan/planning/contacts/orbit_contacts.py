"""The oracle for bodies that look the same all around the axes of their way: contacts on orbits, one table per leg."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dexplan.planning.admissible.admissibility import Admissibility, Margins, worst
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.contacts.oracle import Landing, Progress, Reach, Verdict
from dexplan.planning.contacts.orbit_landfalls import OrbitLandfall, find_landings_on
from dexplan.planning.contacts.states import StateChecks
from dexplan.planning.contacts.stops import Stop, StopKind
from dexplan.planning.ways.travel import Way
from dexplan.plans.contacts import Placement
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.scene.description import Nearness

Holding = tuple[Held, ...]
"""A grip on orbits: the contacts that hold, in the order in which they came."""

STRIDE = 4
"""A first look at a motion checks every so many stations."""
SAME_STATIONS, LIKE_STATIONS = 2, 5
"""Grips within so many stations of one another are the same, or much alike, where their contacts are."""
LIKE_NORMALS = 6.0
"""Contacts are much alike where their normals, as many times as long, are nearest to the same points of the integer grid: within
ten degrees or so."""
OUT_OF_ORDER = Refusal(RefusalKind.ORDER)


@dataclass(eq=False)
class OrbitContacts:
    """Answers for the legs that ``tables`` are of; what takes time is computed when first asked for."""

    tables: list[ContactTable]
    admissibility: Admissibility
    checks: list[StateChecks] = field(init=False)

    def __post_init__(self) -> None:
        self.checks = [StateChecks(table, self.admissibility) for table in self.tables]

    @property
    def hand(self) -> HandModel:
        """The hand whose fingers these are."""
        return self.tables[0].hand

    @property
    def states_checked(self) -> int:
        """Number of states looked at."""
        return sum(checks.count for checks in self.checks)

    def count_stops(self, stretch: int) -> int:
        """Return how many stations a leg has; the last is its end."""
        return self.tables[stretch].stations

    def list_touching(self, grip: Holding) -> tuple[int, ...]:
        """Return the fingers that touch."""
        return tuple(h.finger for h in grip)

    def change(self, grip: Holding, finger: int, touch: Held | None) -> Holding:
        """Return the grip with a finger at another contact, or, None, at none."""
        rest = tuple(h for h in grip if h.finger != finger)
        return rest if touch is None else (*rest, touch)

    def land(self, stretch: int, asked: Sequence[OrbitLandfall]) -> list[list[Landing[Held]]]:
        """Return for each of ``asked`` the most promising places to land that hold with the finger kept and clear all others.

        Where any of those that hold will do, the best with each of them.
        """
        kept = [[one] if one.keep is not None else [replace(one, keep=h) for h in one.held] for one in asked]
        found = iter(find_landings_on(self.tables[stretch], [one for each in kept for one in each]))
        return [[landing for _ in each for landing in next(found)] for each in kept]

    def go(self, grip: Holding, at: Progress, most: int | None = None) -> Reach:
        """Return how far along a leg a grip can take the object; every ``STRIDE``-th station is looked at, and the last."""
        table, checks = self.tables[at.stretch], self.checks[at.stretch]
        limiter = min(grip, key=lambda h: h.left)
        furthest = min(limiter.left, table.stations - at.stop)
        if most is not None:
            furthest = min(furthest, most)
        last = -1
        for k in sorted({*range(0, furthest, STRIDE), furthest}):
            held = self.advance(grip, at, k)
            refusal = checks.refuse(held) or self._refuse_order(table, held)
            if refusal:
                return Reach(last, refusal, refusals=(refusal,))
            last = k
        if at.stop + furthest >= table.stations:
            is_last = at.stretch + 1 == len(self.tables)
            return Reach(furthest, Stop(StopKind.GOAL if is_last else StopKind.LEG_END))
        return Reach(furthest, table.limit(limiter), limiter.finger)

    def _refuse_order(self, table: ContactTable, held: Holding) -> Refusal | None:
        normals = table.with_free({h.finger: table.normal(h) for h in held})
        return None if table.keep_order(normals) else OUT_OF_ORDER

    def advance(self, grip: Holding, at: Progress, stops: int) -> Holding:
        """Return the grip so many stations further on."""
        return tuple(h.carried(stops) for h in grip)

    def enter(self, grip: Holding, at: Progress, stops: int) -> Holding | Refusal:
        """Return the grip that takes the object so many stations on, to the end of its leg, as it begins the next one."""
        table, after, held = self.tables[at.stretch], self.tables[at.stretch + 1], list[Held]()
        for h in grip:
            landed, end = table.placement(h, at.stop), table.state(h.carried(stops))
            contact = after.start_at(h.finger, table.leg.X_WO_end @ landed.X_OF, end.q)
            if contact is None:
                return Refusal(RefusalKind.LEG_END, (self.hand.fingers[h.finger].name,))
            held.append(contact)
        return tuple(held)

    def refuse_carry(self, grip: Holding, at: Progress, stops: int) -> Refusal | None:
        """Return why a grip cannot take the object so many stations on, each of them looked at; None if it can."""
        for k in range(stops + 1):
            if refusal := self.checks[at.stretch].refuse(self.advance(grip, at, k)):
                return refusal
        return None

    def judge_carry(self, grip: Holding, at: Progress, stops: int) -> Verdict:
        """Return the worst margins over all of these stations, each judged exactly; or the first refusal."""
        rows = [self.judge(self.advance(grip, at, k), at) for k in range(stops + 1)]
        refusal = next((row.refusal for row in rows if row.refusal), None)
        return Verdict({} if refusal else worst(rows), refusal)

    def judge(self, grip: Holding, at: Progress) -> Margins:
        """Return the margins of holding the object with a grip, all other fingers at home."""
        return self.checks[at.stretch].judge(grip)

    def refuse_exchange(self, before: Holding, placed: Held, after: Holding, at: Progress) -> Refusal | None:
        """Return why ``placed`` cannot touch beside ``before``, or ``after``, one of them lifted, not hold; the quick answer."""
        checks = self.checks[at.stretch]
        return checks.refuse_together((*before, placed)) or checks.refuse(after)

    def find_nearest(self, grip: Holding, at: Progress) -> Nearness:
        """Return what is nearest to what while all of a grip touch."""
        return self.checks[at.stretch].clear_of(grip, at.stop)

    def list_rests(self, grip: Holding, at: Progress) -> list[tuple[Held, Holding]]:
        """Return which contacts can be lifted, each with the grip that is left: two of it hold alone."""
        rests = [(lifted, tuple(h for h in grip if h is not lifted)) for lifted in grip]
        return [(lifted, rest) for lifted, rest in rests if self.tables[at.stretch].has_pair(rest)]

    def find_way(self, touch: Held, holding: Holding, at: Progress, looks_around: bool) -> Way:
        """Return how a free finger goes between home and a contact while others hold; a detour only if it ``looks_around``."""
        return self.checks[at.stretch].find_way(touch, holding, at.stop, looks_around)

    def may_go_around(self, way: Way, touch: Held, holding: Holding, at: Progress) -> bool:
        """Return whether such a way is not clear though its ends are: then there may be a detour."""
        return self.checks[at.stretch].may_go_around(way, touch, holding, at.stop)

    def class_of(self, grip: Holding, at: Progress) -> Hashable:
        """Return what grips much alike have in common: progress within ten degrees or so, contacts within ten degrees or so."""
        table = self.tables[at.stretch]
        places = frozenset(
            (h.finger, *np.rint(LIKE_NORMALS * table.normal(h)).astype(int).tolist()) for h in grip
        )
        return at.stretch, at.stop // LIKE_STATIONS, places

    def key_of(self, grip: Holding, at: Progress) -> Hashable:
        """Return what makes two grips the same to a search: neighbouring stations count as one."""
        table = self.tables[at.stretch]
        places = frozenset((h.finger, h.orbit, table.station(h) // SAME_STATIONS) for h in grip)
        return at.stretch, at.stop // SAME_STATIONS, places

    def place(self, touch: Held, at: Progress) -> Placement:
        """Return a contact as a plan's value."""
        return self.tables[at.stretch].placement(touch, at.stop)
