"""One finger lifted: the load margin of the remaining pair says what happens."""

from __future__ import annotations

import json

import numpy as np

from dexplan.witness.lifted import BAND, LEAST_MARGIN, SPIN_BAND, draw, lift, predict
from dexplan.witness.outcome import Kind
from dexplan.witness.picture import draw_lifted
from dexplan.witness.report import describe_cases, tabulate_cases


def test_prediction_by_margins() -> None:
    assert predict(0.2, 0.5) == (Kind.HOLD, True)
    assert predict(-0.2, 0.5) == (Kind.SPIN, True)
    assert predict(-0.9, -0.5) == (Kind.DROP, True)
    for unclear in ((0.5 * BAND, 0.5), (-0.5 * BAND, 0.5), (-0.2, 0.5 * SPIN_BAND), (-0.2, -0.5 * BAND)):
        assert not predict(*unclear)[1]


def test_draws_are_seeded_and_cover_every_finger() -> None:
    one, again = draw(7), draw(7)
    np.testing.assert_array_equal(one.directions, again.directions)
    assert (one.sliding, one.lifted) == (again.sliding, again.lifted)
    assert {draw(seed).lifted for seed in range(20)} == {0, 1, 2}


def test_lifted_fingers_do_what_the_margin_predicts(tmp_path) -> None:
    cases = [case for seed in range(14) if (case := lift(draw(seed))) is not None]
    assert len(cases) >= 8
    clear = [c for c in cases if c.is_clear]
    assert len(clear) >= 6
    assert {c.predicted for c in clear} == {Kind.HOLD, Kind.SPIN, Kind.DROP}
    for case in clear:
        assert case.agrees, case
        assert case.lifted_is_off
        assert case.margin_three >= LEAST_MARGIN
        # Torsion that bears anything can only help.
        assert case.margin_pivot >= case.margin_pair - 1e-6
    # The prediction can be wrong: swapped around, the same runs refute it.
    assert any(str(c.outcome.kind) != swapped for c in clear if (swapped := _swap(c.predicted)))
    described = json.loads(json.dumps(describe_cases(cases, 1.0)))
    assert sum(row["count"] for row in described["confusion"]) == len(cases)
    assert f"{len(clear)} of {len(clear)} agree" in tabulate_cases(cases)
    assert draw_lifted(cases, tmp_path / "lifted.png").stat().st_size > 20_000


def _swap(predicted: str) -> str:
    return {"hold": "drop", "drop": "hold", "spin": "hold"}[predicted]
