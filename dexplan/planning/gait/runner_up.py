"""What would have come instead of a placement, found in what a search left behind.

Only what the search knows is told: a rival that it looked at was refused for a reason, one whose turn never came was ranked
behind for what it promised.
"""

from __future__ import annotations

import numpy as np

from dexplan.planning.contacts.held import Held
from dexplan.planning.contacts.orbit_contacts import OrbitContacts
from dexplan.planning.gait.exchange import GaitNode
from dexplan.planning.search.engine import Rival
from dexplan.planning.search.moves import Place
from dexplan.planning.search.nodes import known_bound
from dexplan.plans.runner_up import RunnerUp
from dexplan.spatial import Array

APART = float(np.radians(10.0))
"""Two places of one finger that are nearer than this are the same to the reader [rad]."""


def find_runner_up(
    contacts: OrbitContacts, node: GaitNode, rivals: list[Rival[tuple[Held, ...]]]
) -> RunnerUp | None:
    """Return the best of the ``rivals`` of ``node`` in which another finger is placed, or elsewhere; None where there is none."""
    here = _read_placement(contacts, node)
    if here is None:
        return None
    for rival in rivals:
        there = _read_placement(contacts, rival.node)
        if there is None:
            continue
        is_near = float(np.arccos(np.clip(there[1] @ here[1], -1.0, 1.0))) < APART
        if there[0] == here[0] and is_near:
            continue
        other = rival.node
        return RunnerUp(
            there[0],
            there[1],
            None if rival.refusal is None else rival.refusal.without_numbers,
            known_bound(other),
            known_bound(node),
            other.strain,
            node.strain,
            other.cost - node.cost,
        )
    return None


def _read_placement(contacts: OrbitContacts, node: GaitNode) -> tuple[int, Array] | None:
    """Return the finger that is placed on the way to ``node`` and where (3,) in W, None where there is none."""
    place = node.find_move(Place)
    if place is None or not isinstance(place.touch, Held):
        return None
    leg = contacts.tables[node.at.stretch].leg
    normal_O = contacts.place(place.touch, node.at).normal_O
    return place.finger, leg.pose(node.at.stop)[:3, :3] @ normal_O
