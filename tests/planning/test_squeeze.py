"""How hard fingers squeeze: as ever, less for light objects, and a refusal where that is too little."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.contact.friction import SoftFinger
from dexplan.control.controller import Controller
from dexplan.control.reference import build_reference
from dexplan.planning.admissible.squeeze import DEPTH, choose_squeeze
from dexplan.plans.forces import NormalForces
from dexplan.plans.plan import Plan
from dexplan.problems.read import load_problem
from dexplan.scene.penetration import predict_penetration
from dexplan.sim.judge.validate import load_default_limits

CASES = Path(__file__).parents[1] / "cases"
LIGHT = CASES / "table_tennis_ball.toml"
FRICTION = SoftFinger(0.55 / 1.3, 0.0025 / 1.3)


@pytest.mark.parametrize("mass", [0.02, 0.06, 0.12, 0.4])
def test_objects_that_bear_it_are_squeezed_as_ever(mass: float) -> None:
    problem = load_problem("hold_two", {"object.mass_kg": mass})
    squeeze = pipeline.build_squeeze(problem, pipeline.build_scene(problem))
    assert (squeeze.normal, squeeze.floor, squeeze.refusal) == (NormalForces.target, 4.0, None)
    if mass >= 0.06:
        assert squeeze.ceiling == NormalForces.ceiling


@pytest.mark.parametrize("tip", [0.016, 0.018, 0.026])
@pytest.mark.parametrize("mass", [0.0027, 0.005, 0.01])
def test_light_objects_are_squeezed_as_hard_as_they_bear(mass: float, tip: float) -> None:
    problem = load_problem(LIGHT, {"object.mass_kg": mass, "hand.tip_radii_m": [tip] * 3})
    scene = pipeline.build_scene(problem)
    squeeze = pipeline.build_squeeze(problem, scene)
    assert not squeeze.refusal
    assert squeeze.floor < squeeze.normal < NormalForces.target
    assert max(predict_penetration(scene, i, squeeze.normal) for i in range(3)) == pytest.approx(
        DEPTH, rel=1e-6
    )
    limit = load_default_limits()["penetration_max_um"]
    assert 1e6 * max(predict_penetration(scene, i, squeeze.ceiling) for i in range(3)) < 0.9 * limit


@pytest.mark.parametrize(
    ("mass", "sliding", "words"),
    [(0.0005, 0.55, "0.5 g"), (0.001, 0.55, "1 g"), (0.0027, 0.2, "2.7 g"), (0.005, 0.1, "5 g")],
)
def test_what_bears_too_little_is_refused_with_mass_and_reason(
    mass: float, sliding: float, words: str
) -> None:
    problem = load_problem(
        LIGHT, {"object.mass_kg": mass, "friction.sliding": sliding, "friction.torsional_m": 0.0005}
    )
    plan = pipeline.plan(problem)
    assert plan.status == "object_too_light"
    assert not plan.actions
    assert f"an object of {words} is too light" in plan.reason
    assert "object.mass_kg" in plan.reason
    assert Plan.from_dict(plan.as_dict()).as_dict() == plan.as_dict()


@pytest.mark.parametrize("mass", np.geomspace(0.0027, 0.4, 12))
def test_one_contact_can_bear_what_two_others_press(mass: float) -> None:
    """While fingers are exchanged two of three stand on one side: twice the least force has to stay below the greatest."""
    squeeze = choose_squeeze(float(mass), FRICTION, 460.0 * mass, 580.0 * mass)
    assert 2.0 * squeeze.floor < squeeze.ceiling
    assert squeeze.floor < squeeze.normal <= squeeze.ceiling


@pytest.mark.parametrize(("mass", "bears"), [(0.0038, False), (0.02, True)])
def test_torsional_friction_has_to_bear_what_tips_twist_one_another(mass: float, bears: bool) -> None:
    """3.8 g, tips of 10 mm and little friction: the ball slid in its plane of contact while it was carried."""
    changes = {
        "object.mass_kg": mass,
        "object.radius_m": 0.038,
        "hand.tip_radii_m": [0.01] * 3,
        "friction.sliding": 0.273,
    }
    problem = load_problem("hold_two", changes)
    assert (pipeline.build_squeeze(problem, pipeline.build_scene(problem)).refusal is None) == bears


def test_heavy_objects_are_never_called_too_light() -> None:
    for mass in np.geomspace(0.02, 1.0, 20):
        assert not choose_squeeze(mass, FRICTION, 500.0 * mass, 600.0 * mass).refusal


@pytest.mark.parametrize(("asked", "floor"), [(3.3, 2.4), (5.5, 4.0), (9.0, 4.0)])
def test_the_force_that_is_asked_for_is_planned_with(asked: float, floor: float) -> None:
    problem = load_problem("hold_two", {"forces.normal_N": asked})
    plan = pipeline.plan(problem)
    assert plan.is_solved
    assert (plan.normal_force, plan.normal_ceiling) == (asked, 12.0)
    assert plan.normal_floor == pytest.approx(floor)


def test_floor_and_ceiling_that_are_asked_for_are_kept() -> None:
    """Nothing is lowered for an object that bears them: also not a floor of more than half of the ceiling."""
    changes = {"forces.normal_floor_N": 5.0, "forces.normal_N": 5.5, "forces.normal_ceiling_N": 6.0}
    problem = load_problem("hold_two", changes)
    squeeze = pipeline.build_squeeze(problem, pipeline.build_scene(problem))
    assert (squeeze.floor, squeeze.normal, squeeze.ceiling) == (5.0, 5.5, 6.0)


def test_light_objects_lower_what_is_asked_for() -> None:
    usual, less = (load_problem(LIGHT, {"forces.normal_N": asked}) for asked in (5.5, 3.0))
    scene = pipeline.build_scene(usual)
    squeeze = pipeline.build_squeeze(usual, scene)
    assert squeeze.normal < 3.0
    assert pipeline.build_squeeze(less, scene) == squeeze


def test_more_than_usual_that_is_too_deep_is_refused_with_what_would_do() -> None:
    changes = {"object.mass_kg": 0.02, "forces.normal_N": 15.0}
    plan = pipeline.plan(load_problem("hold_two", changes))
    assert plan.status == "object_too_light"
    assert not plan.actions
    assert "an object of 20 g is too light for the 15 N that are asked for" in plan.reason
    cure = re.search(r"ask for at most ([0-9.]+) N \(forces\.normal_N\)", plan.reason)
    assert cure is not None
    assert 5.5 < float(cure[1]) < 15.0
    assert pipeline.plan(load_problem("hold_two", {**changes, "forces.normal_N": float(cure[1])})).is_solved


def test_less_squeeze_believes_less_friction_and_more_squeeze_not_more() -> None:
    shares = [
        choose_squeeze(0.06, FRICTION, 27.0, 35.0, NormalForces(x, 0.5, 20.0)).friction_share
        for x in (1.2, 3.0, 5.5, 9.0)
    ]
    assert shares[0] < shares[1] < shares[2] == shares[3] == 1.0


@pytest.mark.parametrize("forces", [(4.0, 5.0, 12.0), (5.0, 4.0, 4.5), (5.0, 0.0, 6.0)])
def test_forces_out_of_order_are_a_mistake(forces: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="floor <= target <= ceiling"):
        NormalForces(*forces)


def test_plan_reference_and_controller_use_the_same_forces() -> None:
    problem = load_problem(LIGHT)
    scene = pipeline.build_scene(problem)
    squeeze, plan = pipeline.build_squeeze(problem, scene), pipeline.plan(problem)
    assert plan.is_solved
    assert (plan.normal_force, plan.normal_floor, plan.normal_ceiling) == (
        squeeze.normal,
        squeeze.floor,
        squeeze.ceiling,
    )
    again = Plan.from_dict(plan.as_dict())
    assert (again.normal_floor, again.normal_ceiling) == (plan.normal_floor, plan.normal_ceiling)
    reference = build_reference(plan)
    assert (reference.normal_force, reference.normal_floor) == (plan.normal_force, plan.normal_floor)
    controller = Controller(scene, reference, pipeline.build_options(problem))
    phase = reference.phases[0]
    limits = controller._forces._demand(phase, 0.0).limits
    assert limits.normal_floor == pytest.approx([plan.normal_floor] * len(phase.holding))
    assert limits.normal_ceiling == pytest.approx([plan.normal_ceiling] * len(phase.holding))
    stubborn = Controller(scene, reference, pipeline.build_options(problem, normal_floor=0.1))
    floor = stubborn._forces._demand(phase, 0.0).limits.normal_floor
    assert floor == pytest.approx([0.1] * len(phase.holding))


def test_plans_without_limits_are_read_as_they_were_made() -> None:
    """Older plans of format 1 do not say how hard fingers squeeze: there was one squeeze only."""
    data = json.loads((Path(__file__).parents[1] / "plans" / "format_1.json").read_text(encoding="utf-8"))
    for key in ("normal_floor_N", "normal_ceiling_N", "speed"):
        data.pop(key)
    plan = Plan.from_dict(data)
    assert (plan.normal_floor, plan.normal_ceiling, plan.speed) == (4.0, 12.0, None)
