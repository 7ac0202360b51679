"""How far a contact is foreseen to be carried on a leg: a finger that stands there need not be able to land there."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.legs import Leg
from dexplan.problems.read import load_problem
from dexplan.spatial import Array

UP = np.array([0.0, 0.0, 1.0])
ANGLE = 1.2


@pytest.fixture(scope="module")
def shelved() -> HandModel:
    """Return a hand beside an obstacle: tips can touch near it where they cannot come down along the normal."""
    problem = load_problem("shelf")
    return pipeline.build_hand(problem, pipeline.build_scene(problem))


def find_places(table: ContactTable, finger: int) -> tuple[Array, Array]:
    """Return the normals (N, 3) that a finger reaches on the table's orbits, and which of them are no landing places (N,)."""
    landable = table.candidates[finger]
    # Orbits of one finger follow one another; every station that it reaches is a contact that may be held there.
    rows = [
        (o.normals[k], (m, k))
        for m, o in enumerate(table.orbits)
        if o.finger == finger
        for k in np.flatnonzero(o.is_reached)
    ]
    known = set(zip(landable.orbit.tolist(), landable.station.tolist(), strict=True))
    return np.stack([n for n, _ in rows]), np.array([place not in known for _, place in rows])


@pytest.mark.parametrize("axis", [UP, np.array([1.0, 0.0, 0.0])])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_where_landing_is_refused_the_carry_is_foreseen_all_the_same(
    shelved: HandModel, axis: Array, sense: float
) -> None:
    table = ContactTable(shelved, Leg(shelved.object.X_WO_home, axis, sense * ANGLE))
    errors, refused = [], 0
    for finger in range(len(shelved.fingers)):
        normals, is_refused = find_places(table, finger)
        refused += int(is_refused.sum())
        for n in normals[is_refused][::3]:
            stands = table.start_along(finger, n)
            if stands is None:
                continue
            foreseen = min(table.foresee_carry(finger, n), table.stations)
            errors.append(foreseen - min(stands.left, table.stations))
    assert refused > 20
    assert len(errors) > 10
    # On an orbit of the table the number is that of the contact itself.
    assert np.mean(np.abs(errors) <= 1) > 0.9, errors


def test_no_finger_is_said_to_land_where_it_may_only_stand(shelved: HandModel) -> None:
    table = ContactTable(shelved, Leg(shelved.object.X_WO_home, UP, ANGLE))
    for finger, rows in table.candidates.items():
        normals, is_refused = find_places(table, finger)
        assert len(rows.normals) == len(normals) - is_refused.sum()
        nearest = (rows.normals @ normals[is_refused].T).max(axis=0)
        assert (nearest < 1.0 - 1e-9).all()


def test_nothing_is_foreseen_far_from_what_the_finger_reaches(hand: HandModel) -> None:
    table = ContactTable(hand, Leg(hand.object.X_WO_home, UP, ANGLE))
    for finger, home in enumerate(hand.p_WF_home):
        arm = home - hand.object.X_WO_home[:3, 3]
        assert table.foresee_carry(finger, -arm / np.linalg.norm(arm)) == 0
