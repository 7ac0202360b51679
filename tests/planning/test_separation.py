"""How far two contacts have to be apart to hold alone, in words and as a test; and friction so low that nothing is far enough."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dexplan import pipeline
from dexplan.planning.admissible.separation import compute_opposition, describe_separation
from dexplan.problems.problem import StartSection
from dexplan.problems.read import load_problem

STARTS = {
    "no_force_closure_pair": "auto",
    "start_inadmissible": ((-20.0, 0.0), (160.0, 0.0), "free"),
    "no_admissible_pair": ((0.0, 0.0), (120.0, 0.0), (240.0, 0.0)),
}


@settings(deadline=None, derandomize=True, max_examples=200)
@given(st.floats(-0.5, 1.5), st.floats(0.0, np.pi))
def test_opposition_is_the_angle_between_normals_and_chord(beta_max: float, angle: float) -> None:
    """A pair ``angle`` apart makes (pi - angle) / 2 with its chord; the even cosine must not let a negative limit pass."""
    beta = 0.5 * (np.pi - angle)
    if abs(beta - beta_max) > 1e-6:
        assert (-np.cos(angle) > compute_opposition(beta_max)) == (beta < beta_max)


@settings(deadline=None, derandomize=True, max_examples=100)
@given(st.floats(-1.0, 1.5))
def test_no_angle_beyond_opposite_is_asked_for(beta_max: float) -> None:
    text = describe_separation(beta_max, 0.25)
    asked = re.match(r"(\S+) deg or more apart", text)
    if asked:
        assert float(asked[1]) == pytest.approx(180.0 - 2.0 * np.degrees(beta_max), abs=0.06)
        assert float(asked[1]) <= 180.0
    else:
        assert beta_max <= 0.0
        assert "0.25" in text
        assert "no two contacts hold alone" in text


@pytest.mark.parametrize("status", STARTS)
@pytest.mark.parametrize("sliding", [0.02, 0.0302])
def test_refusals_with_hardly_any_friction_ask_for_nothing_impossible(status: str, sliding: float) -> None:
    """Both cones are narrower than the 1.5 degrees that a pair has to keep to the border of the cone."""
    problem = load_problem("fig4_substitution")
    problem = replace(
        problem,
        friction=replace(problem.friction, sliding=sliding, torsional_m=8e-5),
        start=StartSection(STARTS[status]),  # type: ignore[arg-type]
    )
    plan = pipeline.plan(problem)
    assert plan.status == status
    assert "no two contacts hold alone, not even opposite ones" in plan.reason
    assert f"believed friction of {sliding / problem.friction.safety:.3g}" in plan.reason
    assert "raise the friction" in plan.reason
    assert "deg or more apart" not in plan.reason
