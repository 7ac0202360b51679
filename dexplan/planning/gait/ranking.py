"""The search's heuristic: how many placements are still missing from a node to the goal, and what a way through it will cost."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.gait.exchange import GaitNode
from dexplan.planning.search.cost import CostWeights
from dexplan.planning.search.nodes import known_bound

HEURISTIC_WEIGHT = 3.0
"""How much more a turn still to be made counts than placements already spent.  One placement is taken to be worth half of what
a finger can carry a contact; above 1 the search looks for a good gait soon rather than for the best one at last."""
CERTAIN_SHARE = 0.7
"""So much of the placements that seem to be missing will be needed: what then costs more than a plan in hand is left out."""


@dataclass(eq=False)
class Ranking:
    """Ranks the nodes of one route, whose legs have ``tables``."""

    tables: list[ContactTable]
    rewinds_only: bool
    _worths: dict[int, float] = field(default_factory=dict)

    def rank(self, node: GaitNode) -> float:
        """Return the priority of a node, whose bound is known; the smallest is opened first."""
        # Between equals, prefer grasps that carry easily: small forces and room for error.
        load = node.strain + 30.0 * max(0.0, node.strain - 0.88)
        return node.cost + HEURISTIC_WEIGHT * known_bound(node) + load

    def foresee_cost(self, node: GaitNode, weights: CostWeights) -> float:
        """Return what a way through ``node`` costs at least, if ``CERTAIN_SHARE`` of what seems to be missing is needed."""
        placements = node.cost + CERTAIN_SHARE * known_bound(node)
        turned = sum(abs(table.leg.angle) for table in self.tables)
        return weights.placement * placements + weights.turn * turned + weights.load * node.strain

    def estimate_missing(self, node: GaitNode) -> float:
        """Return about how many placements are missing from a node to the goal."""
        table, lefts = self.tables[node.at.stretch], [h.left for h in node.grip]
        ahead = table.stations - node.at.stop
        missing = self._count_missing(node.at.stretch, ahead, min(node.promise, *lefts), max(lefts))
        if missing and self.rewinds_only:
            missing = 2.0 * missing + 0.5 * self._count_rewind_steps(node)
        later = range(node.at.stretch + 1, len(self.tables))
        if later and not missing and not self.tables[later[0]].leg.is_shift:
            # These contacts begin the next leg: how far would they get there?
            after = self.tables[later[0]]
            lefts = [after.foresee_carry(h.finger, table.normal(h.carried(ahead))) for h in node.grip]
            missing += self._count_missing(later[0], after.stations, min(lefts), max(lefts))
            later = later[1:]
        turns = (i for i in later if not self.tables[i].leg.is_shift)
        return missing + sum(self.tables[i].stations / self._worth(i) for i in turns)

    def _worth(self, leg: int) -> float:
        """Return the stations that one placement is worth on a leg: half of what a finger can carry a contact."""
        table = self.tables[leg]
        if table.leg.is_shift:
            return float(table.stations)
        if leg not in self._worths:
            runs = [np.percentile(c.carry, 90) for c in table.candidates.values() if len(c.carry)]
            self._worths[leg] = max(1.0, 0.5 * float(np.mean(runs))) if runs else 1.0
        return self._worths[leg]

    def _count_missing(self, leg: int, ahead: int, lasts: int, longest: int) -> float:
        """Return about how many placements are missing on a leg to go ``ahead`` stations on with contacts that have so much left.

        A turn ends when one contact is used up; what the other has left then serves the next turn, about half of it.
        """
        if ahead <= lasts:
            return 0.0
        return 0.6 + 0.5 * (ahead - lasts + max(0, ahead - longest)) / self._worth(leg)

    def _count_rewind_steps(self, node: GaitNode) -> int:
        """Return how many placements are missing before the pair that moves the object can do so again."""
        if not node.movers:
            return 0
        fresh = 0.5 * self._worth(node.at.stretch)
        inside = [h.left >= fresh for h in node.grip if h.finger in node.movers]
        # Those that are away come back; those used up leave, when another stands in for them, and come back.
        return len(node.movers) - sum(inside) + inside.count(False)
