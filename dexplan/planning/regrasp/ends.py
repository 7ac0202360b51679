"""Which grips at the end of the object's way are the goal: a given one, or any."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from dexplan.planning.contacts.landings import land_again
from dexplan.planning.contacts.layers import Layers
from dexplan.planning.contacts.oracle import Progress
from dexplan.planning.contacts.still import Stand
from dexplan.planning.regrasp.goal_side import GoalSide


@dataclass(eq=False)
class GoalEnd:
    """The goal grasp of ``side``, or a stand from which it is rolled into.

    ``is_early``: goal contacts may be taken at poses before the last, too, where they are within reach.
    """

    layers: Layers
    side: GoalSide
    is_early: bool = False
    _early: dict[tuple[int, int], list[int]] = field(default_factory=dict, init=False)

    def is_end(self, grip: Stand) -> bool:
        """Return whether a stand at the last pose is an end."""
        return self.side.is_end(grip)

    def list_goals(self, at: Progress, finger: int) -> Sequence[int]:
        """Return the contacts on ways into the goal that a finger may take at a pose."""
        if at.stop == self.layers.last:
            return self.side.wanted.get(finger, [])
        if not self.is_early:
            return []
        key = at.stop, finger
        if key not in self._early:
            still, last = self.layers.poses[at.stop], self.side.still
            self._early[key] = []
            for spot in self.side.wanted.get(finger, []):
                found = land_again(self.layers.hand, still.X_WO, last.spots[spot])
                if found is not None:
                    self._early[key].append(still.add(found, last.labels[spot]))
        return self._early[key]

    def is_goal(self, touch: int, at: Progress) -> bool:
        """Return whether a contact is one of those."""
        return self.layers.poses[at.stop].labels[touch] is not None


class AnyEnd:
    """Any stand at the last pose."""

    def is_end(self, grip: Stand) -> bool:
        """Return that it is one."""
        return True

    def list_goals(self, at: Progress, finger: int) -> Sequence[int]:
        """Return no contacts: landings will do."""
        return ()

    def is_goal(self, touch: int, at: Progress) -> bool:
        """Return that none is asked for."""
        return False
