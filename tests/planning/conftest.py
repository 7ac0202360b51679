"""One hand and one full turn for all tests of planning: a workspace takes seconds, a plan two."""

from __future__ import annotations

import pytest

from dexplan import pipeline
from dexplan.planning.hand import HandModel
from dexplan.planning.plan import Plan
from dexplan.planning.regions import Regions, compute_regions
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem


@pytest.fixture(scope="session")
def problem() -> Problem:
    """Return the built-in full turn by finger substitution."""
    return load_problem("fig4_substitution")


@pytest.fixture(scope="session")
def hand(problem: Problem) -> HandModel:
    """Return the hand of that problem."""
    return pipeline.build_hand(problem, pipeline.build_scene(problem))


@pytest.fixture(scope="session")
def full_turn(problem: Problem) -> Plan:
    """Return the plan of that problem."""
    return pipeline.plan(problem)


@pytest.fixture(scope="session")
def regions(hand: HandModel) -> Regions:
    """Return its regions around the object at home."""
    return compute_regions(hand, hand.object.X_WO_home[:3, 3])
