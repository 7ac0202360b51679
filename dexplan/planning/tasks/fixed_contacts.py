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
from dexplan.planning.contacts.start_pairs import list_pairs
from dexplan.planning.contacts.still import StillContacts
from dexplan.planning.tasks.by_shape import plan_gait
from dexplan.planning.tasks.starting import Start
from dexplan.plans.actions import Action, MoveObject
from dexplan.plans.contacts import Contacts, Placement
from dexplan.plans.goal import RotationGoal
from dexplan.plans.motion import ObjectMotion, rest_at
from dexplan.plans.phases import PlannedPhase, demand_touch
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Cure, Refusal, RefusalKind
from dexplan.plans.status import Status
from dexplan.spatial import Array, read_only

CURE = 'allow "substitution" or "rewind" in gait.primitives'
LOOK_AHEAD = 2.0 * np.pi
"""How far a turn is followed beyond the goal to find its limit [rad]."""
PAIRS = 48
"""So many pairs of contacts on a body are tried where the start may be chosen, the least strained first."""
FINE = float(np.radians(0.5))
"""Spacing of samples, and so how exactly a limit is known [rad]."""


@dataclass(frozen=True, eq=False)
class FixedReach:
    """How far one grasp takes the object: the admissible part of a motion, and what ends it.

    ``count`` samples of ``poses`` (K, 4, 4) are admissible, ``rows`` are their margins, ``ways`` the postures (L, J) per finger.
    ``limit`` is None where the motion can be done to its end.
    """

    poses: Array
    count: int
    rows: list[Margins]
    ways: dict[int, Array]
    limit: Refusal | None
    limiting_finger: int | None

    def __post_init__(self) -> None:
        object.__setattr__(self, "poses", read_only(self.poses))
        object.__setattr__(self, "ways", {finger: read_only(way) for finger, way in self.ways.items()})


def compute_fixed_reach(
    hand: HandModel,
    admissibility: Admissibility,
    contacts: Contacts,
    motion: ObjectMotion,
    count: int | None = None,
) -> FixedReach:
    """Return how far ``contacts``, none of which moves on the object, take it along ``motion`` (``count``: samples of it)."""
    poses = motion.poses(count)
    ways: dict[int, Array] = {}
    finger, last = None, len(poses)
    limit: Refusal | None = None
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
    hand: HandModel, states: dict[int, list[FingerState]], k: int, refusal: Refusal
) -> tuple[Refusal, int | None]:
    """Return what ends a motion at sample ``k``, and the finger whose limit it is; None where no single finger's."""
    tight = min(states, key=lambda f: states[f][k].joint)
    state, name = states[tight][k], hand.fingers[tight].name
    if state.joint < hand.limits.joint_margin:
        chain = hand.fingers[tight].chain
        joint = int(np.argmin(np.minimum(state.q - chain.lower, chain.upper - state.q)))
        words = f"{name} comes to a limit of its joint {joint + 1}"
        return Refusal(
            RefusalKind.JOINT_LIMIT, (name,), state.joint, hand.limits.joint_margin, words=words
        ), tight
    stiff = min(states, key=lambda f: states[f][k].dexterity)
    if states[stiff][k].dexterity < hand.limits.dexterity:
        name, stiffness = hand.fingers[stiff].name, float(states[stiff][k].dexterity)
        return Refusal(RefusalKind.SINGULAR, (name,), stiffness, hand.limits.dexterity), stiff
    return refusal, None


def plan_fixed_contacts(hand: HandModel, goal: RotationGoal, start: Start, node_budget: int) -> Plan:
    """Return the plan that takes the object towards ``goal`` with its first grasp alone.

    ``SOLVED`` where it gets there.  Else ``LIMIT_REACHED``: the actions go as far as the grasp can, and the reason says how
    far that is and what ends it.  ``statistics["reach_deg"]`` is how far this grasp can turn the object about the goal's axis.
    Starts that do not hold are refused as in :func:`plan_rotation`.
    """
    still = RotationGoal(goal.X_WO_start, goal.axis_W, 0.0)
    plan = replace(
        plan_gait(hand, still, start, node_budget),
        X_WO_goal=goal.X_WO_goal,
        axis_W=goal.axis_W,
        turned_angle=None if goal.is_attitude else goal.angle,
    )
    if not plan.is_solved:
        return plan
    admissibility = Admissibility(hand)
    motion = goal.motion
    if start is None and not hand.object.is_isotropic:
        # Where all sides look the same every pair is like every other, turned; elsewhere some go farther.
        farthest = _choose_pair(hand, admissibility, motion) or plan.start_contacts
        plan = replace(plan, start_contacts=farthest)
    contacts = tuple(
        c if c is None or _is_pose_given(start, c.finger) else center_spin(hand, c, motion)
        for c in plan.start_contacts
    )
    fine = max(len(motion.poses()), int(np.ceil(abs(goal.angle) / FINE)) + 1)
    reach = compute_fixed_reach(hand, admissibility, contacts, motion, fine)
    if reach.count < 1:
        return replace(
            plan, status=Status.START_INADMISSIBLE, reason=str(reach.limit), refusal=reach.limit, actions=()
        )
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
        status=Status.LIMIT_REACHED,
        reason=reason,
        refusal=None if limit is None else replace(limit, cure=Cure(CURE)),
        start_contacts=contacts,
        actions=actions,
        statistics=statistics,
    )


def _choose_pair(hand: HandModel, admissibility: Admissibility, motion: ObjectMotion) -> Contacts | None:
    """Return the first of the pairs that hold the object which takes it through ``motion``, or the one that comes farthest."""
    still = StillContacts(hand, motion.X_WO_start, admissibility)
    farthest: tuple[int, Contacts | None] = 0, None
    for stand in list_pairs(still)[:PAIRS]:
        if not still.judge(stand).is_admissible:
            continue
        contacts = tuple(None if c is None else center_spin(hand, c, motion) for c in still.placements(stand))
        reach = compute_fixed_reach(hand, admissibility, contacts, motion)
        if reach.count > farthest[0]:
            farthest = reach.count, contacts
        if reach.limit is None:
            break
    return farthest[1]


def _is_pose_given(start: Start, finger: int) -> bool:
    given = None if start is None else start[finger]
    return isinstance(given, Placement) or (given is not None and given.shape == (4, 4))


def _contacts_after(contacts: Contacts, reach: FixedReach) -> Contacts:
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
    contacts: Contacts,
    reach: FixedReach,
    done: ObjectMotion,
    is_there: bool,
    limit: Refusal | None,
    limiting: int | None,
    furthest: float,
) -> tuple[Action, ...]:
    """Return hold, motion, hold."""
    end = reach.poses[reach.count - 1]
    first = build_hold(contacts, rest_at(done.X_WO_start, done.axis_W), "let the grasp settle")
    after = _contacts_after(contacts, reach)
    ends = f"this grasp could turn it to {furthest:.1f} deg, where {limit}" if limit else "it could go on"
    last = build_hold(
        after,
        rest_at(end, done.axis_W),
        f"the goal is reached; {ends}" if is_there else f"this is as far as the grasp goes: {limit}",
    )
    if done.is_still:
        return (first, last)
    move = MoveObject(
        motion=ObjectMotion.between(done.X_WO_start, end, done.axis_W, done.angle),
        grasping=tuple(sorted(reach.ways)),
        contacts_end=after,
        phases=(PlannedPhase("move", demand_touch(contacts)),),
        why="contacts stay fixed; until " + ("the goal" if is_there else str(limit)),
        limiting_finger=None if is_there else limiting,
        limit="the goal" if is_there else str(limit),
        margins=worst(reach.rows),
    )
    return (first, move, last)
