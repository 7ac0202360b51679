"""Figure 3, frames 1 to 2, as a trial by itself: three fingers hold, a pair rolls apart, the third lifts, the pair holds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dexplan import pipeline
from dexplan.brief import brief_repr
from dexplan.planning.actions.gaits import build_hold
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.rolling.roll_gait import RollToPair, build_roll_actions
from dexplan.plans.actions import Action
from dexplan.plans.motion import rest_at
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.problems.derived import PATCH_PER_TIP
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class ThreeToTwo:
    """What one trial showed: how far the pair rolled on the object [deg], or why not, and the verdict of the run.

    ``turn`` is the planner's status for a whole turn from the same start.
    """

    sliding: float
    tip_radius_m: float
    rolled_deg: float | None
    reason: str
    verdict: str
    failures: tuple[str, ...]
    turn: str

    __repr__ = brief_repr


def build_three_to_two(problem: Problem, *, is_early: bool = False) -> tuple[Plan | None, str]:
    """Return the plan that holds, rolls, lifts and holds from the start of ``problem``; or None and why there is none.

    ``is_early`` leaves the roll out: the third finger lifts though no two contacts hold.
    """
    plan = pipeline.plan(problem)
    if not plan.is_solved:
        return None, plan.reason
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    X_WO = plan.X_WO_start
    rolling = RollToPair(hand, X_WO, plan.start_contacts, Admissibility(hand))
    found = next(rolling.options(), None)
    if found is None:
        return None, "; ".join(map(str, rolling.explain()))
    still = rest_at(X_WO, UP)
    hold = build_hold(plan.start_contacts, still, "let the grasp settle")
    roll, lift = build_roll_actions(found, hand, X_WO, UP)
    if is_early:
        gone = tuple(None if i == found.lifted else c for i, c in enumerate(plan.start_contacts))
        lift = replace(lift, contacts_end=gone)
    end = build_hold(lift.contacts_end, still, "the pair holds")
    actions: tuple[Action, ...] = (hold, lift, end) if is_early else (hold, roll, lift, end)
    solved = replace(plan, status=Status.SOLVED, reason="", actions=actions)
    return pipeline.time_plan(problem, solved), ""


def run_three_to_two(sliding: float, tip_radius: float, profile: str = "firm") -> ThreeToTwo:
    """Plan and run one trial with the start of ``fig3_rewind``, friction ``sliding`` and tips of ``tip_radius`` [m].

    Torsional friction is the built-in problem's, or the largest that a tip of this size can have where that is less.
    """
    torsional = load_problem("fig3_rewind").friction.torsional_m
    changes: dict[str, object] = {
        "friction.sliding": sliding,
        "friction.torsional_m": min(torsional, PATCH_PER_TIP * sliding * tip_radius),
        "hand.tip_radii_m": [tip_radius] * 3,
        "control.physics_profile": profile,
    }
    turn = pipeline.plan(load_problem("fig3_rewind", changes)).status
    problem = load_problem("fig3_rewind", {**changes, "goal.rotation.angle_deg": 0.0})
    plan, reason = build_three_to_two(problem)
    if plan is None:
        return ThreeToTwo(sliding, tip_radius, None, reason, "none", (), turn)
    report = pipeline.validate(problem, plan, pipeline.rollout(problem, plan))
    way = plan.actions[1].rolls[0].normal_O
    rolled = float(np.degrees(np.arccos(np.clip(way[0] @ way[-1], -1.0, 1.0))))
    failures = tuple(check.name for check in report.failures)
    return ThreeToTwo(sliding, tip_radius, rolled, "", report.verdict, failures, turn)
