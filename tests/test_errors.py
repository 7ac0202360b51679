"""Numbers that are compared in a message are seen to differ."""

from __future__ import annotations

import inspect
import pickle
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dexplan.errors import DexplanError, ProblemError, spell_apart
from dexplan.problems.read import load_problem

NUMBERS = st.floats(-1e4, 1e4)


@settings(deadline=None, derandomize=True, max_examples=300)
@given(NUMBERS, NUMBERS, st.integers(0, 4))
def test_numbers_that_differ_are_written_differently(value: float, bound: float, decimals: int) -> None:
    one, other = spell_apart(value, bound, decimals)
    assert (one == other) == (repr(value) == repr(bound))
    assert float(one) == pytest.approx(value, abs=0.51 * 10.0**-decimals)


@pytest.mark.parametrize(
    ("value", "texts"),
    [
        (1.9, ("1.9", "2.0")),
        (1.96, ("1.96", "2.00")),
        (1.99996, ("1.99996", "2.00000")),
        (2.0 - 4e-16, ("1.9999999999999996", "2.0")),
    ],
)
def test_decimals_grow_with_how_near_numbers_are(value: float, texts: tuple[str, str]) -> None:
    assert spell_apart(value, 2.0) == texts


@pytest.mark.parametrize("sliding", [0.31, 0.553, 0.7771, 0.99993])
@pytest.mark.parametrize("tip", [0.0123, 0.018])
def test_the_torsional_friction_that_is_named_is_accepted(sliding: float, tip: float) -> None:
    changes = {"hand.tip_radii_m": [tip, 0.02, 0.02], "friction.sliding": sliding}
    with pytest.raises(ProblemError) as refused:
        load_problem("hold_three", {**changes, "friction.torsional_m": 0.1})
    named = float(str(refused.value).split(" = ")[1].split(" m")[0])
    problem = load_problem("hold_three", {**changes, "friction.torsional_m": named})
    assert problem.friction.torsional_m == named
    with pytest.raises(ProblemError):
        load_problem("hold_three", {**changes, "friction.torsional_m": named + 2e-7})
    assert replace(problem).friction.sliding == sliding


def list_kinds(kind: type[DexplanError] = DexplanError) -> list[type[DexplanError]]:
    return [kind, *(deeper for sub in kind.__subclasses__() for deeper in list_kinds(sub))]


@pytest.mark.parametrize("kind", list_kinds(), ids=lambda kind: kind.__name__)
def test_an_error_survives_its_way_out_of_a_worker_process(kind: type[DexplanError]) -> None:
    taken = inspect.signature(kind).parameters.values() if kind.__init__ is not DexplanError.__init__ else [0]
    needed = [p for p in taken if not isinstance(p, inspect.Parameter) or p.default is p.empty]
    error = kind(*[f"word{i}" for i in range(len(needed))])
    error.trace = "what was recorded"  # type: ignore[attr-defined]
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert str(again) == str(error)
    assert vars(again) == vars(error)
