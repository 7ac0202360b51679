"""What tests share: the standard hand, its regions and plans, an empty folder to stand in, a pipeline that does nothing.

A workspace takes seconds and a plan two, so both are made once per session.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from fake_run import make_pipeline

import dexplan
from dexplan import pipeline as verbs
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regions.regions import Regions, compute_regions
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem


@pytest.fixture(scope="session")
def problem() -> Problem:
    """The built-in full turn by finger substitution."""
    return load_problem("fig4_substitution")


@pytest.fixture(scope="session")
def hand(problem: Problem) -> HandModel:
    """The hand of that problem."""
    return verbs.build_hand(problem, verbs.build_scene(problem))


@pytest.fixture(scope="session")
def full_turn(problem: Problem) -> Plan:
    """The plan of that problem."""
    return verbs.plan(problem)


@pytest.fixture(scope="session")
def regions(hand: HandModel) -> Regions:
    """The hand's regions around the object at home."""
    return compute_regions(hand, hand.object.X_WO_home[:3, 3])


@pytest.fixture
def cwd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, in which the test runs."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def pipeline(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A pipeline that does nothing, in place of the real one."""
    fake = make_pipeline()
    monkeypatch.setitem(sys.modules, "dexplan.pipeline", fake)  # type: ignore[arg-type]
    monkeypatch.setattr(dexplan, "pipeline", fake, raising=False)
    return fake
