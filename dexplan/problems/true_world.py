"""A problem that says how the world truly is, beside the one that planner and controller believe."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dexplan.errors import ProblemError
from dexplan.problems.problem import FORMAT, Problem
from dexplan.problems.read import build_problem
from dexplan.sim.judge.true_world import META, PHYSICAL, join_world

STILL = {"rotation": {"axis": [0.0, 0.0, 1.0], "angle_deg": 0.0}}


def check_world(problem: Problem, world: object) -> None:
    """Raise ProblemError where ``world`` is no problem, makes no sense, or differs from ``problem`` in more than the world."""
    if not isinstance(world, Problem):
        fact = f"it is of type {type(world).__name__}"
        raise ProblemError("world", "", fact, "a Problem is accepted, such as load_problem gives")
    _check(problem, world.as_dict())


def read_recorded_world(problem: Problem, meta: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Return the true world that a record's meta names as the data of a problem, None where that is ``problem`` itself.

    Raises ProblemError where it is no world of ``problem``.
    """
    recorded = meta.get(META)
    if recorded is None:
        return None
    if not isinstance(recorded, Mapping):
        raise ProblemError(
            "trace.npz", META, f"{recorded!r:.40} is no problem", "accepted: a problem's tables"
        )
    _check(problem, recorded)
    return recorded


def _check(problem: Problem, world: Mapping[str, Any]) -> None:
    joined = join_world(problem.as_dict(), world)
    # Start contacts, stated as points on a ball of another size, are the problem's, and not the world's to answer for.
    parts = {
        table: {key: joined[table][key] for key in keys if key in joined[table]}
        for table, keys in PHYSICAL.items()
    }
    parts["friction"]["safety"] = joined["friction"]["safety"]
    rest = {"format": FORMAT, "name": "world", "scene": joined["scene"], "obstacles": joined["obstacles"]}
    build_problem({**rest, "goal": STILL, **parts}, "world")
