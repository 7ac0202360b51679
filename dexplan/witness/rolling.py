"""One fingertip rolls on the held ball, in MuJoCo, while the others hold: trials and what they measured.

A trial is an ordinary run: a plan of hold, roll, hold, followed by the controller and judged by the validator.  What is measured
here besides is the geometry of rolling: where the contact and the tip ended against where the theory says.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan import pipeline
from dexplan.brief import brief_repr
from dexplan.contact.rolling.manoeuvre import RollingTriangle
from dexplan.errors import DexplanError
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.tip_rotation import refuse_rotation
from dexplan.planning.rolling.roll_gait import follow_roll, judge_ways
from dexplan.planning.rolling.rolls import as_roll, build_roll, end_placement
from dexplan.plans.actions import Action, Roll
from dexplan.plans.contacts import Contacts, Placement
from dexplan.plans.phases import MUST, PlannedPhase
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.plans.tip_roll import TipRoll
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.sim.judge.replay import replay
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.trace import Trace
from dexplan.spatial import Array, build_frame

HOLDING_DEG = ((-38.0, 0.0), (102.0, 0.0))
"""Where two fingers hold the ball."""
PLACES_DEG = ((240.0, 0.0), (226.0, 0.0), (212.0, 0.0))
"""Where the third finger starts to roll: in front of its base, or aside, where its links get out of each other's way."""
ROLLING_FINGER = 2


@dataclass(frozen=True)
class RollTrial:
    """What one trial measured; angles in degrees, lengths in millimetres.

    ``place_deg`` azimuth and elevation of the start; ``verdict`` of the validator and its ``failures``; ``net_mm`` how far the
    contact came on the ball along the straight way from start to end, ``net_planned_mm`` by theory; ``spin_deg`` the tip's turn
    about the contact normal relative to parallel transport, ``spin_planned_deg``; ``contact_error_deg`` the validator's
    ``roll_path_error_max``; ``slip_mm`` the length of the contact's sliding, ``rolled_mm`` of its way; ball errors over the
    whole run.
    """

    heading_deg: float
    place_deg: tuple[float, float]
    verdict: str
    failures: tuple[str, ...]
    net_mm: float
    net_planned_mm: float
    spin_deg: float
    spin_planned_deg: float
    contact_error_deg: float
    slip_mm: float
    rolled_mm: float
    ball_mm: float
    ball_deg: float

    __repr__ = brief_repr

    def as_dict(self) -> dict[str, Any]:
        """Return the trial as JSON data."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self).items()}


def build_roll_problem(
    profile: str = "firm", place_deg: tuple[float, float] = PLACES_DEG[0], **changes: object
) -> Problem:
    """Return the problem of holding the ball still with all three fingers; ``changes`` as in ``load_problem``."""
    contacts = [list(c) for c in (*HOLDING_DEG, place_deg)]
    return load_problem(
        "hold_three", {"start.contacts_deg": contacts, "control.physics_profile": profile, **changes}
    )


def compute_heading(placement: Placement, heading: float) -> Array:
    """Return the direction (3,) in object axes that makes ``heading`` [rad] with the contact frame's first tangent."""
    R = build_frame(-placement.normal_O)
    return np.asarray(np.cos(heading) * R[:, 0] + np.sin(heading) * R[:, 1])


@dataclass(frozen=True, eq=False)
class Stand:
    """The hand holding the ball with three fingers, ready for one of them to roll."""

    problem: Problem
    place_deg: tuple[float, float]
    hand: HandModel
    plan: Plan

    __repr__ = brief_repr

    @classmethod
    def build(cls, problem: Problem, place_deg: tuple[float, float] = PLACES_DEG[0]) -> Stand:
        """Return the stand of a problem that holds still.  Raises DexplanError where its start does not hold."""
        plan = pipeline.plan(problem)
        if not plan.is_solved:
            raise DexplanError(
                f"the start does not hold the ball ({plan.reason}); contacts that hold it are accepted"
            )
        return cls(problem, place_deg, pipeline.build_hand(problem, pipeline.build_scene(problem)), plan)

    @property
    def start(self) -> Placement:
        """Where the rolling finger touches."""
        start = self.plan.start_contacts[ROLLING_FINGER]
        assert start is not None
        return start

    def plan_roll(self, legs: Sequence[TipRoll]) -> tuple[Plan | None, str]:
        """Return the plan that holds, rolls one finger leg by leg and holds; or None and why the hand cannot do it."""
        first, last = self.plan.actions[0], self.plan.actions[-1]
        contacts, actions = list(self.plan.start_contacts), [first]
        judge = Admissibility(self.hand)
        for leg in legs:
            before = contacts[leg.finger]
            assert before is not None
            q, refusal = follow_roll(self.hand, self.plan.X_WO_start, leg, before.q)
            if not refusal:
                ways = {c.finger: np.repeat(c.q[None], len(q), axis=0) for c in contacts if c is not None}
                ways[leg.finger] = q
                _, refusal = judge_ways(self.hand, judge, self.plan.X_WO_start, ways)
            if refusal:
                return None, str(refusal)
            contacts[leg.finger] = end_placement(self.hand, leg, before, q[-1])
            actions.append(_build_action(first, tuple(contacts), leg))
        if refusal := refuse_rotation(self.hand, actions):
            return None, str(refusal)
        actions.append(replace(last, contacts_end=tuple(contacts)))
        solved = replace(self.plan, actions=tuple(actions), status=Status.SOLVED)
        return pipeline.time_plan(self.problem, solved), ""


def build_stands(profile: str) -> list[Stand]:
    """Return the stands of all places from which the finger may start to roll."""
    return [Stand.build(build_roll_problem(profile, place), place) for place in PLACES_DEG]


def _build_action(hold: Action, contacts: Contacts, leg: TipRoll) -> Roll:
    return Roll(
        motion=hold.motion,
        grasping=hold.grasping,
        contacts_end=contacts,
        phases=(PlannedPhase("roll", (MUST,) * len(contacts)),),
        why="a trial of rolling",
        rolls=(leg,),
    )


@dataclass(frozen=True)
class Refusal:
    """A trial that the finger cannot follow, and why."""

    heading_deg: float
    reason: str


def sweep_straight(
    stands: Sequence[Stand], angle: float, headings_deg: Sequence[float]
) -> Iterator[RollTrial | Refusal]:
    """Yield a straight roll over ``angle`` [rad] of the ball for every heading that the hand can do from one of its places."""
    count = max(25, int(np.ceil(np.degrees(angle))) + 1)

    def build(stand: Stand, heading: float) -> list[list[TipRoll]]:
        return [[build_roll(stand.hand, stand.start, compute_heading(stand.start, heading), angle, count)]]

    for heading in headings_deg:
        yield _try(stands, build, heading)


def sweep_triangles(
    stands: Sequence[Stand], leg: float, apex: float, headings_deg: Sequence[float]
) -> Iterator[RollTrial | Refusal]:
    """Yield a rolling triangle of ``leg`` and ``apex`` [rad] towards every heading that the hand can do from one of its places.

    Where a triangle cannot be followed its mirror image may still be, which gets as far.
    """

    def build(stand: Stand, heading: float) -> list[list[TipRoll]]:
        start, radius = stand.start, float(np.linalg.norm(stand.start.point_O))
        triangle = RollingTriangle(stand.problem.hand.tip_radii_m[start.finger], radius, leg, apex)
        direction = compute_heading(start, heading)
        paths = [t.roll(start.X_OF, direction, 181) for t in (triangle, triangle.mirrored)]
        return [[as_roll(start.finger, path, k) for k in range(3)] for path in paths]

    for heading in headings_deg:
        yield _try(stands, build, heading)


def _try(
    stands: Sequence[Stand], build: Callable[[Stand, float], list[list[TipRoll]]], heading_deg: float
) -> RollTrial | Refusal:
    """Run the first way that the hand can do, place after place."""
    reason = ""
    for stand in stands:
        for legs in build(stand, float(np.radians(heading_deg))):
            plan, why = stand.plan_roll(legs)
            if plan is not None:
                return run_trial(stand, plan, heading_deg)
            reason = reason or why
    return Refusal(heading_deg, reason)


def run_trial(stand: Stand, plan: Plan, heading_deg: float) -> RollTrial:
    """Simulate and judge ``plan`` and measure how its finger rolled."""
    trace = pipeline.rollout(stand.problem, plan)
    report = pipeline.validate(stand.problem, plan, trace)
    return measure_trial(plan, trace, report, heading_deg, stand.place_deg)


def measure_trial(
    plan: Plan,
    trace: Trace,
    report: ValidationReport,
    heading_deg: float,
    place_deg: tuple[float, float] = PLACES_DEG[0],
) -> RollTrial:
    """Return what a run of one rolling finger shows, from a replay of its controls."""
    legs = [roll for action in plan.actions for roll in action.rolls]
    finger, steps = legs[0].finger, int(trace["physics_steps_per_sample"])
    seen = replay(trace.model_xml, trace["initial_state"], trace["ctrl"], steps)
    R_WO = Rotation.from_quat(seen.object_pose[:, 3:], scalar_first=True)
    R_OF = (R_WO.inv() * Rotation.from_matrix(seen.tip_rotation[:, finger])).as_matrix()
    rolls = np.flatnonzero([bool(a.rolls) for a in plan.actions])
    samples = np.flatnonzero(np.isin(trace["action_index"], rolls))
    points = seen.contact_point_O[:, finger]
    normals = points / np.linalg.norm(points, axis=1, keepdims=True)
    radius = float(np.linalg.norm(points[samples[0]]))
    slip = np.linalg.norm(seen.contact_slip_velocity[samples, finger, :2], axis=1)
    way = np.linalg.norm(np.diff(points[samples], axis=0), axis=1)
    tick = float(trace["time"][1] - trace["time"][0])
    first, last = samples[0], samples[-1]

    def value(name: str) -> float:
        found = report[name].value
        return float("nan") if found is None else found

    return RollTrial(
        heading_deg=heading_deg,
        place_deg=place_deg,
        verdict=report.verdict,
        failures=tuple(check.name for check in report.failures),
        net_mm=1e3 * radius * _angle(normals[first], normals[last]),
        net_planned_mm=1e3 * radius * _angle(legs[0].normal_O[0], legs[-1].normal_O[-1]),
        spin_deg=_measure_spin(normals[first], R_OF[first], normals[last], R_OF[last]),
        spin_planned_deg=_measure_spin(
            legs[0].normal_O[0], legs[0].X_OF[0, :3, :3], legs[-1].normal_O[-1], legs[-1].X_OF[-1, :3, :3]
        ),
        contact_error_deg=value("roll_path_error_max"),
        slip_mm=1e3 * tick * float(slip.sum()),
        rolled_mm=1e3 * float(way.sum()),
        ball_mm=value("position_error_max"),
        ball_deg=value("rotation_error_max"),
    )


def _angle(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _measure_spin(n_first: Array, R_first: Array, n_last: Array, R_last: Array) -> float:
    """Return the tip's turn [deg] about the outward normal beyond parallel transport along the straight way.

    Transport turns n_first into n_last the short way; what is left of the tip's rotation is a tilt of the contact on the tip,
    if there is one, and a spin about the normal: the twist of the rest about ``n_last``.
    """
    axis = np.cross(n_first, n_last)
    transport = Rotation.from_rotvec(axis / max(float(np.linalg.norm(axis)), 1e-15) * _angle(n_first, n_last))
    rest = (Rotation.from_matrix(R_last) * (transport * Rotation.from_matrix(R_first)).inv()).as_quat(
        scalar_first=True
    )
    turn = 2.0 * float(np.arctan2(rest[1:] @ n_last, rest[0]))
    return float(np.degrees((turn + np.pi) % (2.0 * np.pi) - np.pi))
