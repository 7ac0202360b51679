"""Object manipulation with the grasp as it is: no finger leaves its contact, and the first one at its limit ends the motion.

The paper's motivation [paper §1]: with fixed contacts an object goes only as far as the workspaces of its fingers, and it takes
rolling and gaiting to go beyond.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dexplan.planning.actions.coordinated import center_spin
from dexplan.planning.actions.gaits import build_hold
from dexplan.planning.admissible.admissibility import (
    Admissibility,
    FingerState,
    Margins,
    compute_finger_states,
    worst,
)
from dexplan.planning.admissible.carry import follow_object, judge_carry
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.tasks.object_manipulation import Start, plan_rotation
from dexplan.plans.goal import RotationGoal
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.plan import MUST, MUST_NOT, Action, Placement, Plan, PlannedPhase
from dexplan.spatial import Array, read_only

LIMIT_REACHED = "limit_reached"
"""Status of a plan that goes as far as the grasp can, and not to the goal."""
CURE = 'allow "substitution" or "rewind" in gait.primitives'
LOOK_AHEAD = 2.0 * np.pi
"""How far a turn is followed beyond the goal to find its limit [rad]."""
FINE = float(np.radians(0.5))
"""Spacing of samples, and so how exactly a limit is known [rad]."""


@dataclass(frozen=True, eq=False)
class FixedReach:
    """How far one grasp takes the object: the admissible part of a motion, and what ends it.

    ``count`` samples of ``poses`` (K, 4, 4) are admissible, ``rows`` are their margins, ``ways`` the postures (L, J) per finger.
    ``limit`` is "" where the motion can be done to its end.
    """

    poses: Array
    count: int
    rows: list[Margins]
    ways: dict[int, Array]
    limit: str
    limiting_finger: int | None

    def __post_init__(self) -> None:
        object.__setattr__(self, "poses", read_only(self.poses))
        object.__setattr__(self, "ways", {finger: read_only(way) for finger, way in self.ways.items()})


def compute_fixed_reach(
    hand: HandModel,
    admissibility: Admissibility,
    contacts: tuple[Placement | None, ...],
    motion: ObjectMotion,
    count: int | None = None,
) -> FixedReach:
    """Return how far ``contacts``, none of which moves on the object, take it along ``motion`` (``count``: samples of it)."""
    poses = motion.poses(count)
    ways: dict[int, Array] = {}
    limit, finger, last = "", None, len(poses)
    for c in contacts:
        if c is None:
            continue
        ways[c.finger], refusal = follow_object(hand, c, poses[:last])
        if refusal:
            limit, finger, last = refusal, c.finger, len(ways[c.finger])
    states = {f: compute_finger_states(hand, f, way[:last]) for f, way in ways.items()}
    rows, refusal = judge_carry(hand, admissibility, states, motion, poses[:last])
    if refusal:
        limit, finger = _name_limit(hand, states, len(rows), refusal)
    return FixedReach(poses, len(rows), rows, ways, limit, finger)


def _name_limit(
    hand: HandModel, states: dict[int, list[FingerState]], k: int, refusal: str
) -> tuple[str, int | None]:
    """Return what ends a motion at sample ``k``, and the finger whose limit it is; None where no single finger's."""
    tight = min(states, key=lambda f: states[f][k].joint)
    state, name = states[tight][k], hand.fingers[tight].name
    if state.joint < hand.limits.joint_margin:
        chain = hand.fingers[tight].chain
        joint = int(np.argmin(np.minimum(state.q - chain.lower, chain.upper - state.q)))
        return f"{name} comes to a limit of its joint {joint + 1}", tight
    stiff = min(states, key=lambda f: states[f][k].dexterity)
    if states[stiff][k].dexterity < hand.limits.dexterity:
        return f"{hand.fingers[stiff].name} comes near a singular posture", stiff
    return refusal, None


def plan_fixed_contacts(hand: HandModel, goal: RotationGoal, start: Start, node_budget: int) -> Plan:
    """Return the plan that takes the object towards ``goal`` with its first grasp alone.

    Status "solved" where it gets there.  Else "limit_reached": the actions go as far as the grasp can, and the reason says how
    far that is and what ends it.  ``statistics["reach_deg"]`` is how far this grasp can turn the object about the goal's axis.
    Starts that do not hold are refused as in :func:`plan_rotation`.
    """
    still = RotationGoal(goal.X_WO_start, goal.axis_W, 0.0)
    plan = replace(
        plan_rotation(hand, still, start, node_budget),
        X_WO_goal=goal.X_WO_goal,
        axis_W=goal.axis_W,
        turned_angle=None if goal.is_attitude else goal.angle,
    )
    if not plan.is_solved:
        return plan
    admissibility = Admissibility(hand)
    motion = ObjectMotion(goal.X_WO_start, goal.axis_W, goal.angle, goal.shift_W)
    contacts = tuple(
        c if c is None or _is_pose_given(start, c.finger) else center_spin(hand, c, motion)
        for c in plan.start_contacts
    )
    fine = max(len(motion.poses()), int(np.ceil(abs(goal.angle) / FINE)) + 1)
    reach = compute_fixed_reach(hand, admissibility, contacts, motion, fine)
    if reach.count < 1:
        return replace(plan, status="start_inadmissible", reason=reach.limit, actions=())
    is_there = reach.count == len(reach.poses)
    done = motion if is_there else motion.part(0.0, (reach.count - 1) / (len(reach.poses) - 1))
    limit, limiting, further = reach.limit, reach.limiting_finger, 0.0
    if is_there and goal.angle != 0.0:
        after = _contacts_after(contacts, reach)
        beyond = ObjectMotion(reach.poses[-1], goal.axis_W, np.copysign(LOOK_AHEAD, goal.angle), np.zeros(3))
        ahead = compute_fixed_reach(hand, admissibility, after, beyond, round(LOOK_AHEAD / FINE) + 1)
        limit, limiting = ahead.limit, ahead.limiting_finger
        further = FINE * max(0, ahead.count - 1)
    furthest = float(np.degrees(abs(done.angle) + further))
    actions = _build_actions(contacts, reach, done, is_there, limit, limiting, furthest)
    statistics = {**plan.statistics, "reach_deg": furthest}
    if is_there:
        return replace(plan, start_contacts=contacts, actions=actions, statistics=statistics)
    share = (reach.count - 1) / (len(reach.poses) - 1)
    reason = f"with fixed contacts the object goes {_spell(goal, share)}, until {limit}; ask for no more than that, or {CURE}"
    return replace(
        plan,
        status=LIMIT_REACHED,
        reason=reason,
        start_contacts=contacts,
        actions=actions,
        statistics=statistics,
    )


def _is_pose_given(start: Start, finger: int) -> bool:
    given = None if start is None else start[finger]
    return isinstance(given, Placement) or (given is not None and given.shape == (4, 4))


def _contacts_after(
    contacts: tuple[Placement | None, ...], reach: FixedReach
) -> tuple[Placement | None, ...]:
    last = reach.count - 1
    return tuple(None if c is None else replace(c, q=reach.ways[c.finger][last]) for c in contacts)


def _spell(goal: RotationGoal, share: float) -> str:
    """Return how far of how much, in words."""
    parts = []
    if goal.angle != 0.0:
        done, asked = np.degrees([share * goal.angle, goal.angle])
        parts.append(f"{done:.1f} of {asked:.1f} deg")
    if np.any(goal.shift_W):
        asked = 1e3 * float(np.linalg.norm(goal.shift_W))
        parts.append(f"{share * asked:.1f} of {asked:.1f} mm")
    return " and ".join(parts)


def _build_actions(
    contacts: tuple[Placement | None, ...],
    reach: FixedReach,
    done: ObjectMotion,
    is_there: bool,
    limit: str,
    limiting: int | None,
    furthest: float,
) -> tuple[Action, ...]:
    """Return hold, motion, hold."""
    X, end = done.X_WO_start, reach.poses[reach.count - 1]
    still = {"axis_W": done.axis_W, "angle": 0.0}
    first = build_hold(list(contacts), {**still, "X_WO_start": X, "X_WO_end": X}, "let the grasp settle")
    after = _contacts_after(contacts, reach)
    ends = f"this grasp could turn it to {furthest:.1f} deg, where {limit}" if limit else "it could go on"
    last = build_hold(
        list(after),
        {**still, "X_WO_start": end, "X_WO_end": end},
        f"the goal is reached; {ends}" if is_there else f"this is as far as the grasp goes: {limit}",
    )
    if done.is_still:
        return (first, last)
    move = Action(
        kind="move_object",
        finger=None,
        grasping=tuple(sorted(reach.ways)),
        X_WO_start=X,
        X_WO_end=end,
        axis_W=done.axis_W,
        angle=done.angle,
        contacts_end=after,
        phases=(PlannedPhase("move", tuple(MUST_NOT if c is None else MUST for c in contacts)),),
        why="contacts stay fixed; until " + ("the goal" if is_there else limit),
        limiting_finger=None if is_there else limiting,
        limit="the goal" if is_there else limit,
        margins=worst(reach.rows),
    )
    return (first, move, last)
