"""The goal grasp seen from behind: stands from which nothing but its last finger, or a roll, is missing.

Near the goal there are few ways, and in most attitudes of the object where there is none a few looks show it: who of the fingers
could come to its goal contact last?  Where no two contacts of the goal hold, so that nobody can be put down last, the goal grasp
is rolled into: a pair of it is rolled apart until it holds alone, and the plan does that backwards.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.layers import Layers
from dexplan.planning.contacts.still import Labels, Stand, StillContacts, change_stand
from dexplan.planning.contacts.track import Track
from dexplan.planning.regrasp.relocation_bound import Pair, RelocationBound
from dexplan.planning.rolling.roll_gait import RollPlan
from dexplan.planning.rolling.roll_to_goal import RollEveryPair
from dexplan.planning.ways.travel import refuse_way
from dexplan.plans.contacts import Contacts
from dexplan.plans.motion import rest_at
from dexplan.plans.refusal import Refusal, RefusalCount, RefusalKind
from dexplan.spatial import Array

OPTIONS = 2
"""Ways to roll into the goal grasp, and out of the start grasp, that searches may use for every pair of fingers."""


@dataclass(eq=False)
class GoalSide:
    """The goal contacts with the object at ``X_WO`` (4, 4), and the stands that lead into them.

    ``roots``: per stand the fingers that hold while the last one comes to its contact; ``options``: how the goal grasp is rolled
    into from there.  ``wanted``: per finger the spots of ``still`` that these stands use.  ``refusal``: why there is no way in at
    all, None where there may be one; ``is_rolled``: whether rolling was tried.
    """

    hand: HandModel
    admissibility: Admissibility
    X_WO: Array
    goal: Contacts
    still: StillContacts = field(init=False)
    roots: dict[Stand, list[Pair]] = field(default_factory=dict, init=False)
    options: dict[Stand, RollPlan | None] = field(default_factory=dict, init=False)
    wanted: dict[int, list[int]] = field(default_factory=dict, init=False)
    refusal: Refusal | None = field(default=None, init=False)
    is_rolled: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        self.still = StillContacts(self.hand, self.X_WO, self.admissibility)
        stand = tuple(None if c is None else self.still.add(c, 0) for c in self.goal)
        self.refusal = self._enter({stand: None})
        if self.refusal and None not in stand:
            # No pair holds, or the one that does lets nobody in: another one that is rolled apart may.
            self.is_rolled = True
            rolled, refusal = self._roll(stand)
            self.refusal = self._enter(rolled) if rolled else refusal

    def _roll(self, stand: Stand) -> tuple[dict[Stand, RollPlan | None], Refusal | None]:
        """Return stands from which the goal grasp is rolled into, and why there is none (None if there is)."""
        search = RollEveryPair(self.hand, self.X_WO, self.goal, self.admissibility)
        found: dict[Stand, RollPlan | None] = {}
        for number, option in enumerate(search.first_of_every_pair(OPTIONS), start=1):
            before = list(stand)
            for roll in option.rolls:
                contact = option.contacts[roll.finger]
                assert contact is not None
                before[roll.finger] = self.still.add(contact, number)
            found[tuple(before)] = option
        if found:
            return found, None
        return found, Refusal(RefusalKind.CANNOT_ROLL_APART, ("goal",), because=search.explain())

    def _enter(self, options: dict[Stand, RollPlan | None]) -> Refusal | None:
        """Note the stands that fingers can come into one after another; return why there is none."""
        refusals = RefusalCount()
        for stand, option in options.items():
            pairs, refused = self._find_last(stand)
            refusals.update(refused)
            if not pairs:
                continue
            bound = RelocationBound(self._layers, {stand: pairs})
            if bound.count_pairs() <= len(pairs):
                refusals.add(Refusal(RefusalKind.NO_PLACE))
                continue
            self.roots[stand], self.options[stand] = pairs, option
            for f, spot in enumerate(stand):
                if spot is not None:
                    self.wanted.setdefault(f, []).append(spot)
        if self.roots:
            return None
        return refusals.list_common(1)[0]

    def _find_last(self, stand: Stand) -> tuple[list[Pair], list[Refusal]]:
        """Return the fingers that can hold while the last one comes to its contact, and why others cannot."""
        still = self.still
        touching = [f for f, s in enumerate(stand) if s is not None]
        if len(touching) == 2:
            return [(touching[0], touching[1])], []
        pairs, refusals = [], []
        for a, b in combinations(touching, 2):
            last = next(f for f in touching if f not in (a, b))
            before, spot, name = change_stand(stand, last, None), stand[last], self.hand.fingers[last].name
            spots = [s for s in before if s is not None]
            assert spot is not None
            if not still.forms_pair(*spots):
                cause = Refusal(RefusalKind.NOT_ALONE)
            elif refusal := still.judge(stand).refusal or still.judge(before).refusal:
                cause = refusal
            elif (way := still.find_way(before, spot)).clearance < self.hand.limits.clearance:
                cause = refuse_way(self.hand, way.nearest)
            else:
                pairs.append((a, b))
                continue
            refusals.append(Refusal(RefusalKind.CANNOT_COME_LAST, (name,), because=(cause,)))
        return pairs, refusals

    def is_end(self, stand: Stand) -> bool:
        """Return whether a stand is the goal grasp, or one from which that is rolled into."""
        return self.still.label(stand) in self._ends

    def find_option(self, stand: Stand) -> RollPlan | None:
        """Return how the goal grasp is rolled into from an end; None where it is the goal grasp itself."""
        return self._ends[self.still.label(stand)]

    @cached_property
    def _ends(self) -> dict[Labels, RollPlan | None]:
        return {self.still.label(stand): option for stand, option in self.options.items()}

    @property
    def _layers(self) -> Layers:
        layers = Layers(self.hand, self.admissibility, Track((rest_at(self.X_WO),)))
        layers.poses = [self.still]
        return layers
