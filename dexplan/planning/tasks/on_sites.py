"""A turn or shift without the fast path: the same question, no symmetry of the object made use of.

It is what gaits on orbits are held against, and the path of objects that look the same around no axis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations, count, product

import numpy as np

from dexplan.planning.actions.joining import build_move_actions, enclose
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.landings import ASIDE, FACING, build_landings
from dexplan.planning.contacts.legs import Leg
from dexplan.planning.contacts.still import Stand, StillContacts
from dexplan.planning.contacts.track import Track
from dexplan.planning.gait.routes import build_routes
from dexplan.planning.regrasp.any_grip import FoundGait, SiteGait
from dexplan.planning.search.options import Primitive
from dexplan.planning.tasks.blocked import (
    StartContact,
    find_start_direction,
    find_start_point,
    refuse_region,
    refuse_start_contact,
)
from dexplan.planning.tasks.no import No
from dexplan.planning.tasks.object_manipulation import refuse
from dexplan.planning.tasks.pair_survey import PairSurvey, explain_no_pair, spell_no_pair
from dexplan.planning.tasks.start_spins import center_start_spins
from dexplan.planning.tasks.starting import Start
from dexplan.plans.contacts import Contacts, Placement, list_holding
from dexplan.plans.goal import RotationGoal
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Cure, Refusal
from dexplan.plans.status import Status

STRETCH = 20
"""Nodes that the search of a route may open before another may have its turn."""


def plan_rotation_on_sites(
    hand: HandModel,
    goal: RotationGoal,
    start: Start,
    node_budget: int,
    primitives: tuple[Primitive, ...] = ("substitution",),
) -> Plan:
    """Return a plan that takes the object to ``goal`` by finger gaiting, as ``plan_rotation`` does on orbits.

    ``primitives``: with "rewind" alone one pair of fingers moves the object; else any fingers do, and each relocation may be
    one of either kind.  No plan is an answer with a status: ``no_gait`` where everything was tried, ``budget_exhausted`` where
    nodes ran out, or one of those that refuse a start.
    """
    admissibility = Admissibility(hand)
    landed = None if start is None else _land_start(hand, admissibility, goal, start)
    if isinstance(landed, No):
        return refuse(hand, goal, landed.status, landed.reason, landed.refusal)
    question, opened = _Question(hand, admissibility, goal, start, landed, primitives), 0
    # Places beside a finger make a search twice as wide: they come where those that face it do not do.
    for facing in (FACING,) if hand.object.is_isotropic else (FACING, ASIDE):
        plan = _search(question, node_budget - opened, facing)
        opened += int(plan.statistics.get("nodes", 0.0))
        if plan.is_solved or plan.status is Status.BUDGET_EXHAUSTED:
            break
    return replace(plan, statistics={**plan.statistics, "nodes": float(opened)})


@dataclass(frozen=True, eq=False)
class _Question:
    """What is asked, and the start contacts as they ``landed``; None where the planner chooses."""

    hand: HandModel
    admissibility: Admissibility
    goal: RotationGoal
    start: Start
    landed: Contacts | None
    primitives: tuple[Primitive, ...]


def _search(question: _Question, node_budget: int, facing: float) -> Plan:
    """Return the answer with the places that ``facing`` admits."""
    hand, goal, landed, admissibility = (
        question.hand,
        question.goal,
        question.landed,
        question.admissibility,
    )
    tracks = [Track(tuple(map(_as_motion, route))) for route in build_routes(goal)]
    ways = list(product(tracks, _list_movers(hand, landed, question.primitives)))
    begun: list[SiteGait] = []
    opened = 0
    for turn in count():
        # One way more has its turn every time; each goes on where it stopped.
        if turn < len(ways):
            track, movers = ways[turn]
            contacts = landed and center_start_spins(hand, landed, question.start, track.motions[0])
            begun.append(SiteGait(hand, admissibility, track, contacts, movers, facing=facing))
            if turn + 1 == len(ways) // len(tracks) and not any(gait.has_start for gait in begun):
                return _refuse_every_start(hand, goal, admissibility, begun[0])
        going = [gait for gait in begun if not gait.is_exhausted]
        if opened >= node_budget or not (going or turn < len(ways)):
            break
        for gait in going:
            before = gait.opened
            found = gait.run(min(STRETCH, node_budget - opened))
            opened += gait.opened - before
            if found is not None:
                return _build(hand, goal, found, opened)
    if not opened and (refusal := begun[0].refuse_goal()):
        shorten = "; shorten goal.translation_m" if np.any(goal.shift_W) else ""
        reason = f"no two fingers can hold the object at the goal: {spell_no_pair(refusal)}{shorten}"
        return refuse(hand, goal, Status.GOAL_UNREACHABLE, reason, refusal)
    why = begun[0].explain()
    status = Status.BUDGET_EXHAUSTED if any(not gait.is_exhausted for gait in begun) else Status.NO_GAIT
    # Where no node was opened, it is the geometry that says no.
    reason = f"no gait on sites within {opened} nodes ({why})" if opened else f"no gait: {spell_no_pair(why)}"
    stuck = refuse(hand, goal, status, reason, why)
    return replace(stuck, start_contacts=landed or stuck.start_contacts, statistics={"nodes": float(opened)})


def _list_movers(
    hand: HandModel, start: Contacts | None, primitives: tuple[Primitive, ...]
) -> list[tuple[int, int] | None]:
    """Return the pairs of fingers of which one alone is to move the object; None where any fingers may."""
    if "substitution" in primitives:
        return [None]
    fingers = range(len(hand.fingers)) if start is None else list_holding(start)
    return list(combinations(fingers, 2))


def _as_motion(leg: Leg) -> ObjectMotion:
    return ObjectMotion(leg.X_WO_start, leg.axis_W, leg.angle, leg.shift_W)


def _build(hand: HandModel, goal: RotationGoal, found: FoundGait, opened: int) -> Plan:
    start = found.start
    actions = build_move_actions(found.moves, start, goal.axis_W)
    return replace(
        refuse(hand, goal, Status.SOLVED, ""),
        start_contacts=start,
        actions=enclose(actions, start, goal.X_WO_start, goal.axis_W),
        statistics={"nodes": float(opened)},
    )


def _refuse_every_start(
    hand: HandModel, goal: RotationGoal, admissibility: Admissibility, gait: SiteGait
) -> Plan:
    """Return the answer where no pair of landings holds the object at its start."""
    if hand.object.is_isotropic:
        refusal = explain_no_pair(PairSurvey(hand, goal.X_WO_start, admissibility))
    else:
        refusal = gait.explain()
    reason = f"no two fingers can hold the object: {spell_no_pair(refusal)}"
    return refuse(hand, goal, Status.NO_FORCE_CLOSURE_PAIR, reason, refusal)


def _land_start(
    hand: HandModel,
    admissibility: Admissibility,
    goal: RotationGoal,
    start: tuple[StartContact | None, ...],
) -> Contacts | No:
    """Return the start contacts, or why they cannot be made or do not hold."""
    X_WO = goal.X_WO_start
    contacts: list[Placement | None] = []
    for finger, given in enumerate(start):
        if given is None or isinstance(given, Placement):
            contacts.append(given)
            continue
        point_O, normal_O = find_start_point(hand, X_WO, find_start_direction(X_WO, given))
        if not hand.object.allows(point_O / np.linalg.norm(point_O)):
            return refuse_region(hand.fingers[finger].name)
        landed = build_landings(hand, X_WO, finger, normal_O[None], point_O[None])[0]
        if landed is None:
            return refuse_start_contact(hand, X_WO, finger, given)
        contacts.append(landed)
    still = StillContacts(hand, X_WO, admissibility)
    stand = tuple(None if c is None else still.add(c) for c in contacts)
    refusal = still.judge(stand).refusal
    return tuple(contacts) if refusal is None else _refuse_start_grasp(still, stand, refusal)


def _refuse_start_grasp(still: StillContacts, stand: Stand, refusal: Refusal) -> No:
    """Return the answer to start contacts within reach that do not hold the object."""
    apart, cure = "", 'move them nearer to opposite, or set start.contacts_deg = "auto"'
    if not still.has_pair(stand):
        most = np.degrees(still.lean_max)
        apart = f", and no line between two of them leaves both normals by less than {most:.1f} deg"
    reason = f"the start contacts do not hold the object: {refusal}{apart}; {cure}"
    return No(Status.START_INADMISSIBLE, reason, replace(refusal, cure=Cure(cure)))
