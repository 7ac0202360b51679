"""Evidence about plans for random attitudes of bodies as lines of files, and the numbers that come out of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from dexplan.plans.actions import count_placements
from dexplan.sim.judge.validate import ValidationReport
from dexplan.witness.bodies import Attempt, Question, Verdict

Row = dict[str, Any]


def record(done: Attempt) -> Row:
    """Return an attempt as one line of a file."""
    plan, question = done.plan, done.question
    return {
        "key": question.key,
        "turn_deg": round(float(np.degrees(question.turn.magnitude())), 1),
        "status": str(plan.status),
        "reason": plan.reason,
        "refusal": None if plan.refusal is None else str(plan.refusal.root.kind),
        "planning_s": round(done.planning_s, 3),
        "nodes": plan.statistics.get("nodes"),
        "placements": count_placements(plan.actions),
    }


def record_verdict(question: Question, verdict: Verdict) -> Row:
    """Return what brute force says of a question as one line of a file."""
    return {
        "key": question.key,
        "found": verdict.is_reachable,
        "looked_at_all": verdict.looked_at_all,
        "why": str(verdict),
    }


def record_run(done: Attempt, report: ValidationReport) -> Row:
    """Return what the validator says of an attempt that was carried out, as one line of a file."""
    failed = {c.name: [c.value, c.limit, c.unit] for c in report.checks if c.status == "fail"}
    return {"key": done.question.key, "run": failed or "PASS"}


def summarise(plans: Sequence[Row], verdicts: Sequence[Row], runs: Sequence[Row]) -> Row:
    """Return what came out of questions and runs.

    A plan counts as its own proof; a refusal is what brute force has to agree with.
    """
    said = {row["key"]: row for row in verdicts}
    refused = [row for row in plans if row["status"] != "solved"]
    wrong = [row["key"] for row in refused if said[row["key"]]["found"]]
    unsure = [row["key"] for row in refused if not said[row["key"]]["looked_at_all"]]
    both = [said[row["key"]]["found"] for row in plans if row["status"] == "solved" and row["key"] in said]
    agree = len(plans) - len(wrong)
    interval = binomtest(agree, len(plans)).proportion_ci(method="wilson")
    median, most = np.percentile([row["planning_s"] for row in plans], [50, 95])
    return {
        "questions": len(plans),
        "planned": len(plans) - len(refused),
        "refused": dict(Counter(row["status"] for row in refused)),
        "reasons": dict(Counter(row["refusal"] for row in refused)),
        "agree": agree,
        "agreement": round(agree / len(plans), 4),
        "wilson_95": [round(interval.low, 4), round(interval.high, 4)],
        "refusals_contradicted": wrong,
        "refusals_confirmed_though_not_all_was_looked_at": unsure,
        "plans_that_brute_force_was_asked_about": len(both),
        "of_these_found": sum(both),
        "planning_s_median": round(float(median), 2),
        "planning_s_95": round(float(most), 2),
        "planning_s_longest": max(row["planning_s"] for row in plans),
        "runs": len(runs),
        "runs_passed": sum(row["run"] == "PASS" for row in runs),
        "runs_failed": {row["key"]: row["run"] for row in runs if row["run"] != "PASS"},
    }
