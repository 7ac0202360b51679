"""The search: which finger lifts, where and with which spin it lands, how far the object goes in between.

Best first over grasps (``planning.search``), led by how many placements are still missing.  Everything a node promises is checked
only when the search wants to go through it, and a finished way once more by the judge itself.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dexplan.planning.admissible.admissibility import Admissibility, Margins
from dexplan.planning.admissible.conditions import Condition, find_unmet
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.legs import Leg
from dexplan.planning.contacts.oracle import Progress
from dexplan.planning.contacts.orbit_contacts import Holding, OrbitContacts
from dexplan.planning.gait.exchange import GaitNode
from dexplan.planning.gait.problem import GaitProblem
from dexplan.planning.gait.start_pairs import find_start_pairs
from dexplan.planning.gait.steps import Link, Step, build_steps
from dexplan.planning.search.cost import CostWeights, compute_cost
from dexplan.planning.search.engine import Engine, Patience
from dexplan.planning.search.moves import Lift
from dexplan.planning.search.nodes import Node, trace_back
from dexplan.plans.refusal import Refusal, RefusalKind

PATIENCE = Patience(opened=1.0, failed=0.25)
"""What a node's priority loses, in placements, for every one like it that was opened, or tried in vain, before."""
START = Progress(0, 0)
CURE = "raise the friction, lower friction.safety, or use a lighter object"


class GaitSearch:
    """Searches a gait along the legs of a route; can be asked to go on where it stopped.

    ``primitives``: "substitution", "rewind", or both.  With "rewind" alone the object is only ever moved by one pair of fingers.
    """

    def __init__(
        self,
        hand: HandModel,
        route: tuple[Leg, ...],
        admissibility: Admissibility,
        primitives: tuple[str, ...] = ("substitution",),
        first: ContactTable | None = None,
    ) -> None:
        self.route = route
        self.tables = [first or ContactTable(hand, route[0]), *(ContactTable(hand, leg) for leg in route[1:])]
        self._contacts = OrbitContacts(self.tables, admissibility)
        self._problem = GaitProblem(self._contacts, "substitution" not in primitives)
        self._engine = Engine(self._problem, PATIENCE)

    @property
    def opened(self) -> int:
        """Number of nodes opened."""
        return self._engine.opened

    @property
    def states_checked(self) -> int:
        """Number of states looked at."""
        return self._contacts.states_checked

    @property
    def is_exhausted(self) -> bool:
        """Whether there is nothing left to open."""
        return self._engine.is_exhausted

    @property
    def promise(self) -> float:
        """The estimated cost of the best way to the goal that is left, as :meth:`run` ranks them; inf where none is."""
        return self._engine.promise

    @property
    def reason(self) -> str:
        """The most common refusals, in words."""
        return "; ".join(map(str, self.refusals))

    @property
    def refusals(self) -> list[Refusal]:
        """The most common refusals, numbers left out."""
        return self._engine.list_refusals() or [Refusal(RefusalKind.NO_LANDING)]

    @property
    def unmet(self) -> list[Condition]:
        """Which conditions the most common refusals are about, where they are about some."""
        return [condition for r in self.refusals if (condition := find_unmet(r)) is not None]

    def judge_start(self, held: Holding) -> Margins:
        """Return the margins of the first grasp."""
        return self._contacts.judge(held, START)

    def begin_anywhere(self) -> int:
        """Add pairs to start from where the problem leaves it to the planner; return how many."""
        checks = self._contacts.checks[0]
        pairs = find_start_pairs(self.tables[0], lambda held: checks.refuse(held) is None)
        for pair in pairs:
            self.begin(pair.held, pair.promise, pair.load)
        return len(pairs)

    def begin(
        self,
        held: Holding,
        promise: int | None = None,
        load: float = 0.5,
        movers: tuple[int, ...] | None = None,
    ) -> None:
        """Add a grasp to start from; ``movers`` are the fingers that are to move the object first, where that is asked for."""
        lasts = min(h.left for h in held) if promise is None else promise
        if movers is None:
            # Rewinds go on with the pair they begin with: an exchange before the first motion would be a substitution.
            is_pair = self._problem.rewinds_only and len(held) == 2
            movers = tuple(sorted(h.finger for h in held)) if is_pair else ()
        self._engine.push(Node(START, held, promise=lasts, strain=load, movers=movers))

    def seek_cheaper(self, cost: float, weights: CostWeights) -> None:
        """Go on without what will hardly cost less than ``cost``."""
        self._problem.cost_limit, self._problem.weights = cost, weights

    def run(self, nodes: int) -> GaitNode | None:
        """Open up to ``nodes`` more nodes; return the one from which the goal is reached, None if there was none."""
        return self._engine.run(nodes)

    # -- answer ----------------------------------------------------------------------------------------------------------

    def compute_cost(self, node: GaitNode, weights: CostWeights) -> float:
        """Return what the way to ``node`` and on to the goal costs, a way that :meth:`run` has returned."""
        links = self._link(node)
        legs = [(self.route[one.node.at.stretch], one.node.at.stop, one.moved) for one in links]
        turned = sum(abs(leg.turned(stop + moved) - leg.turned(stop)) for leg, stop, moved in legs)
        shifted = sum(float(np.linalg.norm(leg.shift_W)) for leg in self.route)
        margins = [m for one in links for m in (one.margins, one.place_margins)]
        return compute_cost(weights, node.cost, turned, shifted, margins)

    def steps(self, node: GaitNode) -> list[Step]:
        """Return the way to ``node`` and on to the goal as symbolic steps."""
        return build_steps(self._contacts, self._link(node))

    def _link(self, last: GaitNode) -> list[Link]:
        """Return the way to a node with its margins: those of the judge, which were found when the way was."""
        way = trace_back(last)
        links = []
        for node, moved in zip(way, self._problem.list_motions(way), strict=True):
            carried = self._contacts.judge_carry(node.grip, node.at, moved).margins
            exchanged: Mapping[str, float] = {}
            if node.find_move(Lift) is not None:
                grasp = self._contacts.judge(node.grip, node.at).as_dict()
                least = min(node.arrival.margins["clearance_mm"], grasp["clearance_mm"])
                exchanged = {**grasp, "clearance_mm": least}
            links.append(Link(node, moved, carried, exchanged))
        return links
