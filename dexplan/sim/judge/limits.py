"""Which limits may be set, which way each is looser, and what was loosened; the numbers are in ``limits.toml``."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from types import MappingProxyType

from dexplan.errors import ProblemError

INTEGRITY: Mapping[str, str] = MappingProxyType(
    {
        "replay_matches": "a record is the run it claims to be or it is not",
        "trace_consistent": "recorded contacts are the replayed ones or they are not",
        "trace_force_tolerance_N": "it is part of trace_consistent",
        "trace_point_tolerance_mm": "it is part of trace_consistent",
        "trace_time_tolerance_s": "it is part of trace_consistent",
        "physics_untouched": "physics is honest or it is not",
        "files_agree": "the files of one run do not contradict each other",
        "object_support_other_N": "nothing but fingertips may hold the object",
        "force_qp_solved_status": "it is what a recorded status means",
    }
)
"""Names that no problem may set, and why: they say whether a run can be believed at all, not how good it has to be."""

FLOORS = frozenset({"creep_moving_speed_deg_s", "episode_gap_s"})
"""Limits that are looser the smaller they are, beside those with ``_min`` in their names."""


@dataclass(frozen=True)
class LooseLimit:
    """A limit that is looser than its default."""

    name: str
    value: float
    default: float

    def __str__(self) -> str:
        return f"{self.name} {self.value:.6g} instead of {self.default:.6g}"


def load_default_limits() -> dict[str, bool | float]:
    """Return every limit with its default, from the packaged limits.toml."""
    return dict(_read_limits())


@lru_cache
def _read_limits() -> Mapping[str, bool | float]:
    text = resources.files("dexplan.sim.judge").joinpath("limits.toml").read_text(encoding="utf-8")
    return MappingProxyType(tomllib.loads(text))


def is_floor(name: str) -> bool:
    """Return whether the limit is a least value, which is looser the smaller it is."""
    return "_min" in name or name in FLOORS


def explain_refusal(name: str, value: float) -> tuple[str, str] | None:
    """Return why the limit ``name`` may not have this value, and what is accepted; None where it may."""
    if not math.isfinite(value):
        return f"{value} is not a finite number", "accepted: a number, 0 or more"
    if value < 0:
        return f"{value:g} is negative", "accepted: a number, 0 or more"
    default = _read_limits()[name]
    if name in INTEGRITY and value != default:
        return (
            f"{value:g} is given for what cannot be set, since {INTEGRITY[name]}",
            f"accepted: {default:g}, or no such line",
        )
    return None


def resolve_limits(*given: Mapping[str, bool | float]) -> dict[str, bool | float]:
    """Return the default limits, replaced by those ``given``, the later ones over the earlier ones.

    Raises ProblemError for a name that is no limit, a value that is none, and anything but the default of an
    integrity check.
    """
    limits = load_default_limits()
    for layer in given:
        for name, value in layer.items():
            key = f"acceptance.{name}"
            if name not in limits:
                raise ProblemError("problem", key, "there is no such limit", f"accepted: {', '.join(limits)}")
            if not isinstance(value, int | float):
                raise ProblemError("problem", key, f"{value!r} is no number", "accepted: a number, 0 or more")
            if (refusal := explain_refusal(name, float(value))) is not None:
                raise ProblemError("problem", key, *refusal)
            limits[name] = value
    return limits


def find_loose_limits(limits: Mapping[str, bool | float]) -> tuple[LooseLimit, ...]:
    """Return those of ``limits`` that are looser than their defaults, in the order of the packaged file."""
    loose = []
    for name, default in _read_limits().items():
        value = limits.get(name, default)
        if isinstance(default, bool):
            is_loose = value != default
        else:
            is_loose = value < default if is_floor(name) else value > default
        if is_loose:
            loose.append(LooseLimit(name, float(value), float(default)))
    return tuple(loose)
