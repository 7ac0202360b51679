"""The paper's theorems as boundaries: coarse, but through the whole hand and with the bounds that are demanded."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan.witness.diagram import (
    FRICTIONS,
    CurvePoint,
    PhaseDiagram,
    describe_settings,
    measure_boundary,
    measure_point,
)
from dexplan.witness.experiments import (
    EXPERIMENTS,
    MASS,
    PATCH,
    PRELOAD,
    RADIUS,
    Experiment,
    compute_load_aware,
    compute_margin,
)
from dexplan.witness.outcome import Kind
from dexplan.witness.picture import draw_diagram
from dexplan.witness.report import tabulate

BY_NAME = {e.name: e for e in EXPERIMENTS}
WEIGHT = MASS * 9.81
every_experiment = pytest.mark.parametrize("experiment", EXPERIMENTS, ids=lambda e: e.name)


@every_experiment
@pytest.mark.parametrize("mu", FRICTIONS)
def test_simulated_boundary_is_where_the_load_margin_says(experiment: Experiment, mu: float) -> None:
    """Two degrees, 0.02 r, 10 %, 10 %: the hand holds on one side, gives way on the other."""
    boundary = measure_boundary(experiment, mu, steps=1)
    assert boundary.is_within, boundary
    # Bracketed by runs on both sides, within the servos' limits, and not assumed.
    assert boundary.runs >= 3
    assert boundary.resolution <= 0.5 * boundary.demand
    assert boundary.torque_share <= 1.0
    assert boundary.gives_way in {Kind.SPIN, Kind.SLIP, Kind.DROP}
    if experiment.name == "torsion":
        assert boundary.gives_way == Kind.SPIN


@pytest.mark.parametrize("mu", FRICTIONS)
def test_load_aware_boundaries_against_algebra(mu: float) -> None:
    """The linear program's zero margins against what the weight does to each closed form."""
    # N^2 (1 - (tan b / mu)^2) = (m g / 2 mu)^2 + (m g R tan b / 2 mu_t)^2, the chord passing R sin b beside the centre.
    slope = np.tan(np.radians(90.0 - 0.5 * compute_load_aware(BY_NAME["pair"], mu)))
    load = np.hypot(0.5 * WEIGHT / mu, 0.5 * WEIGHT * RADIUS * slope / (mu * PATCH))
    assert PRELOAD * np.sqrt(1.0 - (slope / mu) ** 2) == pytest.approx(load, rel=1e-3)
    # Upwards, per finger: mu N cos - N sin carries a third of the weight, sin = h / r.
    height = compute_load_aware(BY_NAME["triple"], mu)
    lift = PRELOAD * (mu * np.sqrt(1.0 - height**2) - height)
    assert lift == pytest.approx(WEIGHT / 3.0, rel=1e-4)
    # Torsion and half the weight share one cone; the pull carries the weight first.
    torsion = 2e3 * mu * PATCH * np.sqrt(PRELOAD**2 - (0.5 * WEIGHT / mu) ** 2)
    assert compute_load_aware(BY_NAME["torsion"], mu) == pytest.approx(torsion, rel=1e-4)
    assert compute_load_aware(BY_NAME["shear"], mu) == pytest.approx(2.0 * mu * PRELOAD + WEIGHT, rel=1e-4)


@every_experiment
def test_margin_falls_across_the_boundary(experiment: Experiment) -> None:
    aware = compute_load_aware(experiment, 0.5)
    sign = 1.0 if experiment.holds_above else -1.0
    step = 0.5 * experiment.demand(experiment.closed_form(0.5))
    margins = [compute_margin(experiment, 0.5, aware + sign * k * step) for k in (2, 1, 0, -1, -2)]
    assert (np.diff(margins) < 0.0).all()
    assert abs(margins[2]) < 1e-4


@pytest.mark.parametrize(
    ("name", "believed"), [("pair", 0.55), ("triple", 0.55), ("torsion", 0.6), ("shear", 0.6)]
)
def test_a_wrong_friction_shows(name: str, believed: float) -> None:
    """The demands can fail: whoever takes mu 0.5 for more is told so by the world."""
    boundary = measure_boundary(BY_NAME[name], 0.5, steps=0, believed=believed)
    assert boundary.difference is not None
    assert not boundary.is_within, boundary


def test_points_of_the_picture_and_the_picture(tmp_path) -> None:
    pair = BY_NAME["pair"]
    grid = (measure_point(pair, 0.5, 150.0), measure_point(pair, 0.5, 110.0))
    assert [p.outcome.kind is Kind.HOLD for p in grid] == [True, False]
    assert all(p.agrees for p in grid)
    boundary = measure_boundary(pair, 0.5, steps=0)
    curve = tuple(
        CurvePoint(e.name, mu, e.closed_form(mu), e.closed_form(mu)) for e in EXPERIMENTS for mu in (0.3, 0.8)
    )
    diagram = PhaseDiagram((boundary,), curve, grid, describe_settings())
    assert not diagram.misses
    assert diagram.as_json()["boundaries"][0]["is_within"]
    assert "pair" in tabulate(diagram.boundaries)
    assert draw_diagram(diagram, tmp_path / "diagram.png").stat().st_size > 20_000
