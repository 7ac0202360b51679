"""What of a record is stepped again: state, controls and steps, refused in one sentence where they are no recipe."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dexplan.errors import RunFolderError
from dexplan.spatial import Array

LONGEST_SAMPLE = 10_000
"""Most physics steps between two samples: ten seconds at the step of every scene.  More would only keep a judge busy."""


class Recipe(NamedTuple):
    """The replay's ingredients, in the order in which :func:`dexplan.sim.judge.replay.replay` takes them."""

    initial_state: Array
    ctrl: Array
    physics_steps_per_sample: int
    xfrc_applied: Array | None


def read_recipe(columns: Mapping[str, NDArray[Any]]) -> Recipe:
    """Return the recipe in a record; RunFolderError names what is missing or is no number."""
    for name in ("initial_state", "ctrl", "physics_steps_per_sample"):
        if name not in columns:
            raise _refuse(f"lacks {name}")
    if not columns["ctrl"].size:
        raise _refuse("lacks samples")
    return Recipe(
        _read_numbers(columns, "initial_state"),
        _read_numbers(columns, "ctrl"),
        _read_steps(columns),
        _read_numbers(columns, "xfrc_applied") if "xfrc_applied" in columns else None,
    )


def check_times(columns: Mapping[str, NDArray[Any]], steps: int, timestep: float) -> None:
    """Refuse steps per sample that are not what the recorded times say, before they are stepped.

    Single wrong times are judged; this is about a recipe for another run, which may take for ever.
    """
    time = columns.get("time")
    if time is None or time.dtype.kind not in "fiu" or time.ndim != 1 or len(time) < 2:
        return
    with np.errstate(invalid="ignore"):
        spacing = float(np.median(np.diff(time.astype(np.float64))))
    if np.isfinite(spacing) and not abs(spacing - steps * timestep) <= 1e-6 * timestep:
        raise _refuse(
            f"{steps} physics steps of {timestep:g} s per sample do not make the {spacing:g} s between its recorded times",
            "a record of one run is needed",
        )


def _read_numbers(columns: Mapping[str, NDArray[Any]], name: str) -> Array:
    if columns[name].dtype.kind not in "bfiu":
        raise _refuse(f"{name} holds {columns[name].dtype} where numbers are needed")
    return np.asarray(columns[name], dtype=np.float64)


def _read_steps(columns: Mapping[str, NDArray[Any]]) -> int:
    steps = _read_numbers(columns, "physics_steps_per_sample")
    if steps.shape != () or not 1 <= steps <= LONGEST_SAMPLE or steps != np.floor(steps):
        fact = f"{steps:g}" if steps.shape == () else f"an array of shape {steps.shape}"
        raise _refuse(
            f"physics_steps_per_sample is {fact}", f"a whole number from 1 to {LONGEST_SAMPLE} is needed"
        )
    return int(steps)


def _refuse(fact: str, accepted: str = "a trace that can be replayed is needed") -> RunFolderError:
    return RunFolderError("trace.npz", f"it {fact}" if fact.startswith("lacks") else fact, accepted)
