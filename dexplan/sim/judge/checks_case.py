"""What every check is given and what it gives back, and the few masks over samples that several checks share.

A check is a pure function of a :class:`Case`: problem and plan as data, recorded columns, replay and limits.
It names its limit; the number comes from the problem.  What cannot be measured fails: NaN and empty
measurements are never a pass.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.sim.judge.replay import Replay
from dexplan.sim.judge.world import Flags, Indices
from dexplan.spatial import Array, lock_arrays

Status = Literal["pass", "fail", "not_applicable", "not_recorded"]
"""What a check says; "not_recorded" where it asks for what a run of this controller does not have: no failure, and no pass."""
UNKNOWN, MUST_NOT, MAY, MUST = -1, 0, 1, 2
"""What the plan asks of one finger at one sample; unknown where the claimed action or phase does not exist.
"""
_TOUCH = {"must_not": MUST_NOT, "may": MAY, "must": MUST}


@dataclass(frozen=True)
class CheckResult:
    """One physical claim, measured: ``value`` and ``limit`` in ``unit``, the worst moment [s], and what else
    to know.
    """

    name: str
    status: Status
    value: float | None
    limit: float | None
    unit: str
    worst_time_s: float | None = None
    note: str = ""


@dataclass(frozen=True, eq=False)
class Case:
    """What is judged: ``columns`` are the record's, ``replay`` what the validator's own stepping gave (T
    samples).

    ``problem`` has the world's parameters as they are true, ``believed`` as planner and controller were told (None: as they are).
    ``controller`` names the one that the run was made with, None for dexplan's own.
    """

    problem: Mapping[str, Any]
    plan: Mapping[str, Any]
    columns: Mapping[str, NDArray[Any]]
    replay: Replay
    limits: Mapping[str, bool | float]
    initial_state: Array | None = None
    differences: tuple[str, ...] = ()
    """In what the machine that recorded the run differs from this one; none: a replay has to match to the last bit."""
    contradictions: tuple[str, ...] = ()
    """What the files that this was read from say against each other."""
    believed: Mapping[str, Any] | None = None
    controller: str | None = None

    __repr__ = brief_repr

    def limit(self, name: str) -> float:
        """Return the number behind a limit's name."""
        return float(self.limits[name])

    def column(self, name: str, shape: tuple[int, ...] = ()) -> Array | None:
        """Return the recorded column (T, *shape) as floats; None where the record has no numbers of that shape."""
        array = self.columns.get(name)
        if array is None or array.shape != (self.sample_count, *shape) or array.dtype.kind not in "bfiu":
            return None
        return np.asarray(array, dtype=np.float64)

    @cached_property
    def believed_friction(self) -> tuple[float, float]:
        """Sliding and torsional [m] friction that planner and controller count on."""
        friction = (self.problem if self.believed is None else self.believed)["friction"]
        safety = friction["safety"]
        return friction["sliding"] / safety, friction["torsional_m"] / safety

    @property
    def sample_count(self) -> int:
        """Number of samples T."""
        return len(self.replay.time)

    @property
    def finger_count(self) -> int:
        """Number of fingers F."""
        return len(self.replay.world.fingers)

    @cached_property
    def sample_time(self) -> float:
        """Time between samples [s]."""
        return float(np.asarray(self.columns["physics_steps_per_sample"])) * self.replay.world.timestep

    @cached_property
    def weight(self) -> float:
        """Weight of the object [N] as the problem has it, under the simulated gravity."""
        gravity = float(np.linalg.norm(self.replay.world.model.opt.gravity))
        return float(self.problem["object"]["mass_kg"]) * gravity

    @cached_property
    def reference(self) -> Array:
        """The object's reference poses (T, 7); NaN where the record has none."""
        column = self.column("object_pose_reference", (7,))
        return np.full((self.sample_count, 7), np.nan) if column is None else column

    @cached_property
    def phases(self) -> list[tuple[int, int]]:
        """All (action, phase) pairs of the plan, in order."""
        return [(a, p) for a, x in enumerate(self.plan["actions"]) for p in range(len(x["phases"]))]

    @cached_property
    def claimed_phase(self) -> Indices:
        """Position in :attr:`phases` that each sample claims (T,); -1 where there is no such phase."""
        lookup = {pair: i for i, pair in enumerate(self.phases)}
        action, phase = self.column("action_index"), self.column("phase_index")
        if action is None or phase is None:
            return np.full(self.sample_count, -1)
        pairs = zip(action.tolist(), phase.tolist(), strict=True)
        return np.array([lookup.get(pair, -1) for pair in pairs], dtype=np.intp)

    @cached_property
    def required(self) -> Indices:
        """What the plan asks at each sample of each finger (T, F): MUST, MAY, MUST_NOT or UNKNOWN."""
        fingers = self.replay.world.fingers
        table = np.full((len(self.phases) + 1, len(fingers)), UNKNOWN)
        for i, (a, p) in enumerate(self.phases):
            touch = self.plan["actions"][a]["phases"][p]["touch"]
            table[i] = [_TOUCH.get(touch.get(name), UNKNOWN) for name in fingers]
        # Position -1 finds the last row, which stays unknown.
        return table[self.claimed_phase]

    @cached_property
    def is_rolling(self) -> Flags:
        """Samples (T,) of actions in which the plan lets a finger roll on the object."""
        rolls = np.array([bool(action.get("rolls")) for action in self.plan["actions"]] + [False])
        action = self.column("action_index")
        if action is None:
            return np.zeros(self.sample_count, dtype=bool)
        known = (action >= 0) & (action < len(rolls) - 1)
        return rolls[np.where(known, action, len(rolls) - 1).astype(np.intp)]

    @cached_property
    def quiet(self) -> Flags:
        """Samples (T,) farther than ``quiet_distance_s`` from every planned or actual contact change of any
        finger.
        """
        changes = np.zeros(self.sample_count, dtype=bool)
        for states in (self.required, self.replay.contact_active):
            changes[1:] |= np.any(states[1:] != states[:-1], axis=1)
        # A change seen at sample t happened in (t - 1, t].
        reach = int(np.ceil(self.limit("quiet_distance_s") / self.sample_time)) + 1
        return ~widen(changes, reach)

    @cached_property
    def settled(self) -> Flags:
        """Quiet samples at which a finger touches (T, F)."""
        return self.quiet[:, None] & self.replay.contact_active

    @cached_property
    def utilisation(self) -> Array:
        """Measured friction utilisation (T, F): sqrt(f_t^2/mu^2 + tau^2/mu_t^2)/f_n with the problem's
        friction, else NaN.
        """
        friction = self.problem["friction"]
        return compute_utilisation(self.replay.contact_force, friction["sliding"], friction["torsional_m"])


def compute_utilisation(force: Array, sliding: float, torsional: float) -> Array:
    """Return sqrt(f_t^2/mu^2 + tau^2/mu_t^2)/f_n of forces (..., 4); 0 without any force, infinite without a
    normal one.
    """
    load = np.sqrt((force[..., 0] ** 2 + force[..., 1] ** 2) / sliding**2 + force[..., 3] ** 2 / torsional**2)
    normal = force[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(normal > 0, load / normal, np.where(load > 0, np.inf, 0.0))
    return np.where(np.isnan(load + normal), np.nan, ratio)


def widen(mask: Flags, reach: int) -> Flags:
    """Return ``mask`` (T, ...) with every true sample spread ``reach`` samples both ways."""
    total = np.cumsum(np.concatenate([np.zeros((1, *mask.shape[1:])), mask]), axis=0)
    count = len(mask)
    index = np.arange(count)
    return (total[np.minimum(index + reach + 1, count)] - total[np.maximum(index - reach, 0)]) > 0


def close_gaps(mask: Flags, reach: int) -> Flags:
    """Return ``mask`` (T,) with gaps of at most ``reach`` samples between true samples filled."""
    out = mask.copy()
    for start, stop in find_runs(~mask):
        if start > 0 and stop < len(mask) and stop - start <= reach:
            out[start:stop] = True
    return out


def find_runs(mask: Flags) -> list[tuple[int, int]]:
    """Return the maximal stretches [start, stop) of true samples in ``mask`` (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def judge(
    name: str,
    value: float,
    limit: float,
    unit: str,
    time: float | None = None,
    note: str = "",
    *,
    at_least: bool = False,
) -> CheckResult:
    """Return pass where ``value`` is at most (``at_least``: at least) ``limit``; a value that is not finite
    fails.
    """
    if not np.isfinite(value):
        return fail(name, unit, note or f"the value is {value}", limit, time)
    is_good = value >= limit if at_least else value <= limit
    moment = None if time is None or not np.isfinite(time) else float(time)
    return CheckResult(name, "pass" if is_good else "fail", float(value), float(limit), unit, moment, note)


@dataclass(frozen=True, eq=False)
class Series:
    """What is judged: ``values`` (N,) or (N, K) at ``times`` (N,) [s]; ``labels`` (K,) name the columns."""

    values: Array
    times: Array
    labels: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        lock_arrays(self)


def judge_worst(
    name: str, series: Series, limit: float, unit: str, note: str = "", *, at_least: bool = False
) -> CheckResult:
    """Judge the worst value of ``series``.

    A NaN is the worst of all; nothing to judge is a failure.
    """
    values, times, labels = series.values, series.times, series.labels
    if values.size == 0:
        return fail(name, unit, note or "there is nothing to measure", limit)
    order = np.where(np.isnan(values), np.inf, -values if at_least else values)
    index = np.unravel_index(int(np.argmax(order)), values.shape)
    said = [note] if note else []
    if np.isnan(values[index]):
        said.append("a value is not a number")
    if labels and values.ndim == 2:
        said.append(labels[int(index[1])])
    return judge(
        name, float(values[index]), limit, unit, float(times[index[0]]), "; ".join(said), at_least=at_least
    )


def judge_all(name: str, parts: list[CheckResult]) -> CheckResult:
    """Return one result for several: a failed part before a passed one, then the one that uses most of its
    limit.
    """

    def rank(part: CheckResult) -> tuple[bool, float]:
        value = np.inf if part.value is None else part.value
        return part.status == "fail", value / part.limit if part.limit else value

    worst = max(parts, key=rank)
    told = "; ".join(part.note for part in parts if part.note)
    return CheckResult(name, worst.status, worst.value, worst.limit, worst.unit, worst.worst_time_s, told)


def judge_count(
    name: str, wrong: Flags, times: Array, limit: float, note: str = "", labels: tuple[str, ...] = ()
) -> CheckResult:
    """Judge the number of true entries of ``wrong`` (T,) or (T, K); no samples at all is a failure."""
    if wrong.size == 0:
        return fail(name, "count", "there is nothing to measure", limit)
    first = np.argwhere(wrong)
    said = [note] if note else []
    if labels and wrong.ndim == 2:
        said += [f"{label}: {n}" for label, n in zip(labels, wrong.sum(axis=0), strict=True) if n]
    moment = float(times[first[0, 0]]) if len(first) else None
    return judge(name, float(wrong.sum()), limit, "count", moment, "; ".join(said))


def fail(
    name: str, unit: str, note: str, limit: float | None = None, time: float | None = None
) -> CheckResult:
    """Return a failure without a value; the note says why there is none."""
    moment = None if time is None or not np.isfinite(time) else float(time)
    return CheckResult(name, "fail", None, limit, unit, moment, note)
