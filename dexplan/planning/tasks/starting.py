"""The grasp from which a gait begins: the one that the problem gives, or one that the planner chooses."""

from __future__ import annotations

from dataclasses import dataclass

from dexplan.kinematics.spherical_wrist import solve_standing
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.gait.search import GaitSearch
from dexplan.planning.gait.start_pairs import refuse_unreachable
from dexplan.planning.tasks.blocked import StartContact, refuse_region, refuse_start_contact
from dexplan.planning.tasks.no import No
from dexplan.planning.tasks.pair_survey import PairSurvey, explain_no_pair, spell_no_pair
from dexplan.planning.tasks.start_refusals import refuse_start_grasp
from dexplan.plans.contacts import Contacts, Placement
from dexplan.plans.status import Status
from dexplan.spatial import Array

Start = tuple[StartContact | None, ...] | None
"""Per finger the outward normal (3,) in W where it touches at first, or the whole tip pose X_OF (4, 4) in the object frame, or
the placement with which it came to where it stands now, or None for a free finger.  None instead of the tuple where the planner
may choose."""


@dataclass(frozen=True, eq=False)
class Begun:
    """How a search began: the start ``contacts`` as far as they are known, and why it could not begin, None where it did."""

    contacts: Contacts
    no: No | None = None


def find_held(hand: HandModel, X_WO: Array, start: Start, table: ContactTable) -> tuple[Held, ...]:
    """Return the contacts ``start`` on the first leg of a route; none where one of them is out of reach, or none are given."""
    given = [] if start is None else [(i, one) for i, one in enumerate(start) if one is not None]
    held = [_find_contact(hand, X_WO, i, one, table) for i, one in given]
    return tuple(h for h in held if h is not None) if all(held) else ()


def _find_contact(
    hand: HandModel, X_WO: Array, finger: int, given: StartContact, table: ContactTable
) -> Held | None:
    if isinstance(given, Placement):
        # It stands on the branch on which it landed: on its way it has turned nothing over.
        X_WF = X_WO @ given.X_OF
        return table.start_at(finger, X_WF, solve_standing(hand.fingers[finger].chain, X_WF, given.q))
    if given.shape == (4, 4):
        return table.start_at(finger, X_WO @ given)
    return table.start_along(finger, given)


def begin(
    hand: HandModel, X_WO: Array, start: Start, search: GaitSearch, admissibility: Admissibility
) -> Begun:
    """Let ``search`` begin with the contacts ``start``, or with pairs that the planner chooses."""
    nothing: Contacts = (None,) * len(hand.fingers)
    if start is None:
        no = None if search.begin_anywhere() else _begin_off_the_orbits(hand, X_WO, search, admissibility)
        return Begun(nothing, no)
    table, held = search.tables[0], list[Held]()
    for finger, given in enumerate(start):
        if given is None:
            continue
        contact = _find_contact(hand, X_WO, finger, given, table)
        if contact is None:
            return Begun(nothing, refuse_start_contact(hand, X_WO, finger, given))
        if not table.allows(table.normal(contact), 0):
            return Begun(nothing, refuse_region(hand.fingers[finger].name))
        held.append(contact)
    placed = {h.finger: table.placement(h, 0) for h in held}
    contacts = tuple(placed.get(k) for k in range(len(hand.fingers)))
    if no := refuse_start_grasp(table, tuple(held), search.judge_start(tuple(held))):
        return Begun(contacts, no)
    search.begin(tuple(held))
    return Begun(contacts)


def _begin_off_the_orbits(
    hand: HandModel, X_WO: Array, search: GaitSearch, admissibility: Admissibility
) -> No | None:
    """Begin with a pair of a finer grid where none of the orbits' holds, or return the refusal that says why none does."""
    if refusal := refuse_unreachable(search.tables[0]):
        return No(Status.START_UNREACHABLE, f"{refusal}; {refusal.cure}", refusal)
    survey = PairSurvey(hand, X_WO, admissibility)
    found = survey.find_pair()
    if found is None:
        refusal = explain_no_pair(survey)
        reason = f"no two fingers can hold the object: {spell_no_pair(refusal)}"
        return No(Status.NO_FORCE_CLOSURE_PAIR, reason, refusal)
    i, j, v, w = found
    held = [search.tables[0].start_along(f, survey.get_normal(k)) for f, k in ((i, v), (j, w))]
    if all(held):
        search.begin(tuple(h for h in held if h is not None))
    return None
