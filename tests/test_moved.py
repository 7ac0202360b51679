"""Names that the documentation of 0.1.0 spelled out are found for one more release, with a warning that says where they are."""

from __future__ import annotations

import subprocess
import sys
import warnings
from importlib import import_module
from pathlib import Path
from types import UnionType
from typing import get_args

import pytest

from dexplan.moved import MOVED

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTED = [
    "contact.coordinates.ContactCoordinates",
    "contact.manoeuvre.RollingTriangle",
    "contact.manoeuvre.build_longitude_equator",
    "contact.manoeuvre.repeat_triangle",
    "contact.montana.compute_rates",
    "contact.rolling.roll_along",
    "contact.rolling.roll_turning",
    "contact.rolling.solve_two_finger_goals",
    "contact.surface.AbstractSurface",
    "contact.shapes.Ellipsoid",
    "contact.roll_to.roll_to",
    "grasp.force.ForceSolver",
    "grasp.sphere.build_independent_cones",
    "grasp.sphere.check_independent_sufficient",
    "grasp.sphere.check_sphere_pair",
    "grasp.sphere.check_sphere_triple_sufficient",
    "grasp.triple.check_hard_triple",
    "planning.adjustment.plan_grasp_adjustment",
    "planning.configuration_space.classify",
    "planning.dextrous.plan_dextrous_manipulation",
    "planning.escape.find_escapes",
    "planning.fixed_contacts.plan_fixed_contacts",
    "planning.goal.RotationGoal",
    "planning.goal.build_detours",
    "planning.hand.HandModel",
    "planning.overlap.overlap_travel",
    "planning.plan.Action",
    "planning.plan.Plan",
    "planning.planner.plan_rotation",
    "planning.regions.Regions",
    "planning.regions.compute_regions",
    "planning.regions.keeps_order",
    "planning.roll_gait.RollToPair",
    "planning.roll_gait.follow_roll",
    "planning.rolling_carry.plan_rolling_turn",
    "planning.search.GaitSearch",
    "planning.spherical.SphericalRegion",
    "planning.theorems.check_rewind_along",
    "planning.theorems.check_theorem_1",
    "planning.theorems.check_theory_3",
    "planning.tip_rotation.refuse_rotation",
    "scene.chain.Chain",
    "scene.workspace.Workspace",
    "scene.workspace.load_workspace",
    "sim.checks_contact.check_finger_order_kept",
    "sim.checks_contact.check_tip_contact_angle_max",
    "sim.checks_rolling.check_tip_rotation_max",
    "sim.force_audit.ForceAudit",
    "sim.rollout.rollout",
]


@pytest.mark.parametrize("name", DOCUMENTED)
def test_documented_names_warn(name: str) -> None:
    module, _, symbol = f"dexplan.{name}".rpartition(".")
    with pytest.warns(
        DeprecationWarning, match=rf"{module}\.{symbol} is dexplan\..*\.{symbol} since dexplan 0\.2\.0"
    ):
        found = getattr(import_module(module), symbol)
    found = get_args(found)[0] if isinstance(found, UnionType) else found
    assert found.__module__.startswith("dexplan.")
    assert found.__module__ != module


@pytest.mark.parametrize("old", MOVED)
def test_new_homes_exist_and_old_ones_do_not(old: str) -> None:
    assert not (ROOT / (old.replace(".", "/") + ".py")).exists()
    for home in MOVED[old]:
        assert home not in MOVED
        import_module(home)


def test_the_warning_points_at_who_imports() -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        from dexplan.scene.chain import Chain  # type: ignore[import-not-found]  # noqa: F401
    assert {Path(warning.filename).name for warning in caught} == {Path(__file__).name}


def test_unknown_names_are_unknown() -> None:
    with pytest.raises(ModuleNotFoundError):
        import_module("dexplan.planning.nothing")
    for module in ("dexplan.scene.chain", "dexplan.grasp.force"):
        with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
            _ = import_module(module).nothing


def test_dexplan_itself_uses_no_old_name() -> None:
    code = "import dexplan as dx; dx.plan(dx.load_problem('hold_two')); import dexplan.viz.figure, dexplan.witness.report"
    done = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning:dexplan", "-c", code],
        capture_output=True,
        text=True,
        cwd=ROOT,
    )
    assert done.returncode == 0, done.stderr
