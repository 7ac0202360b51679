"""A turn or shift of any body: on orbits where the object looks the same all around, on sites where it does not."""

from __future__ import annotations

from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.search.cost import Improvement
from dexplan.planning.search.options import Primitive
from dexplan.planning.tasks.object_manipulation import FIRST, plan_rotation
from dexplan.planning.tasks.on_sites import plan_rotation_on_sites
from dexplan.planning.tasks.starting import Start
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan


def plan_gait(
    hand: HandModel,
    goal: RotationGoal,
    start: Start,
    node_budget: int,
    primitives: tuple[Primitive, ...] = ("substitution",),
    improvement: Improvement = FIRST,
) -> Plan:
    """Return a plan that takes the object to ``goal`` by finger gaiting, from a start grasp of which two contacts hold.

    Arguments as in :func:`plan_rotation`; on sites the first plan is taken.
    """
    if hand.object.is_isotropic:
        return plan_rotation(hand, goal, start, node_budget, primitives, improvement)
    return plan_rotation_on_sites(hand, goal, start, node_budget, primitives)
