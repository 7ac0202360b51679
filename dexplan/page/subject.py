"""What a page is about: a run with its judgement, or a problem that was refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dexplan.brief import brief_repr
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem
from dexplan.sim.judge.report import ValidationReport
from dexplan.sim.trace import Trace
from dexplan.viz.timeline import build_action_spans


@dataclass(frozen=True, eq=False)
class Subject:
    """A run as one page tells it; ``folder`` holds its pictures and its film, where there are any.

    ``trace`` and ``report`` are None for a refusal, where nothing ran; ``scene`` is then a trace of one sample that shows the
    hand as it would have started.
    """

    folder: Path
    problem: Problem
    plan: Plan
    trace: Trace | None = None
    report: ValidationReport | None = None
    scene: Trace | None = None

    __repr__ = brief_repr

    @property
    def data(self) -> Mapping[str, Any]:
        """The problem as the data of its file."""
        return self.problem.as_dict()

    def find_action(self, time: float) -> int | None:
        """Return which action, by index from 0, holds at a time [s]; None where none does."""
        if self.trace is None:
            return None
        found = [s.action_index for s in build_action_spans(self.trace) if s.start <= time <= s.end]
        known = [k for k in found if 0 <= k < len(self.plan.actions)]
        return known[-1] if known else None


def name_action(index: int) -> str:
    """Return the anchor of an action, which counts from 1 as everything that people read does."""
    return f"action-{index + 1}"
