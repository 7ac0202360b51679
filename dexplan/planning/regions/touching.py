"""Can a finger touch along these directions, and what does it then have to spare?  One question of the field CWS_i at a time.

Fingers with a spherical wrist are answered in closed form, others that can point by Newton steps, any other by its workspace.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dexplan.kinematics.chain import compute_dexterity, compute_joint_margin, wrap_to_limits
from dexplan.kinematics.pointing import can_point, is_same_finger, move_to_base, solve_pointing
from dexplan.kinematics.spherical_wrist import SphericalWrist, find_sampled_branches, find_spherical_wrist
from dexplan.kinematics.workspace import Workspace, compute_aligned_pose
from dexplan.spatial import Array, lock_arrays

SIGHT = float(np.radians(85.0))
"""Directions farther than this from the finger's own are not tried."""
FIRST_STEP_ERROR = 5e-3
"""A Newton step from this far off leaves about a hundredth of it."""
CLOSE = 1e-5
"""Tolerance of exact answers."""
HOPELESS = 0.15
"""Where the joints are this far beyond what they may, nobody asks for the dexterity [rad]."""


@dataclass(frozen=True)
class ContactLimits:
    """What a contact must leave to spare: ``joint_margin`` [rad] to every joint's limits, ``dexterity`` [-]."""

    joint_margin: float
    dexterity: float


@dataclass(frozen=True)
class Toucher:
    """A finger that touches a sphere: its ``workspace``, its tip's place ``home`` [m] in its home posture, and the ``distance``
    [m] between the centres of tip and sphere.
    """

    workspace: Workspace
    home: tuple[float, ...]
    distance: float


@dataclass(frozen=True, eq=False)
class Question:
    """Directions (N, 3) to touch along, for one finger, with postures to start from (N, J)."""

    finger: Toucher
    limits: ContactLimits
    center: Array
    front: Array
    directions: Array
    seeds: Array
    iterations: int
    tolerance: float
    dexterity: Array
    """Dexterity (N,) where it is known well enough, NaN where it is asked for."""

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(frozen=True, eq=False)
class Postures:
    """Postures (N, J) [rad] that point along the directions of a question, whether they touch (N,), and their dexterity (N,)."""

    q: Array
    is_reached: NDArray[np.bool_]
    dexterity: Array

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(frozen=True, eq=False)
class Answer(Postures):
    """What a question is answered: postures, and the field (N,) [rad], what each has to spare."""

    margin: Array


def answer(questions: list[Question]) -> list[Answer]:
    """Answer questions; those of equal fingers, wherever they stand, in one go."""
    found: dict[int, Postures] = {}
    left = list(range(len(questions)))
    while left:
        chain = questions[left[0]].finger.workspace.chain
        group = [
            n
            for n in left
            if is_same_finger(chain, questions[n].finger.workspace.chain)
            and questions[n].iterations == questions[left[0]].iterations
        ]
        wrist = find_spherical_wrist(chain)
        if wrist is not None:
            found |= _solve_closed(wrist, {n: questions[n] for n in group})
        elif can_point(chain):
            goals = [
                move_to_base(
                    questions[n].finger.workspace.chain,
                    questions[n].center + questions[n].finger.distance * questions[n].directions,
                    -questions[n].directions,
                )
                for n in group
            ]
            positions, poles = (np.concatenate(part) for part in zip(*goals, strict=True))
            seeds = np.concatenate([questions[n].seeds for n in group])
            is_asked = np.isnan(np.concatenate([questions[n].dexterity for n in group]))
            q, reached, dexterity = solve_pointing(
                chain,
                positions,
                poles,
                seeds,
                iterations=questions[group[0]].iterations,
                # The dexterity is that before the last step: only where it is asked for must that be close.
                tolerance=np.where(is_asked, questions[group[0]].tolerance, FIRST_STEP_ERROR),
                is_asked=is_asked,
            )
            ends = np.cumsum([len(questions[n].directions) for n in group])[:-1]
            for n, *parts in zip(group, *(np.split(x, ends) for x in (q, reached, dexterity)), strict=True):
                found[n] = Postures(*parts)
        else:
            for n in group:
                ask = questions[n]
                X_WF = compute_aligned_pose(ask.center, ask.directions, ask.finger.distance)
                q, reached = ask.finger.workspace.solve(X_WF)
                found[n] = Postures(q, reached, compute_dexterity(ask.finger.workspace.chain, q))
        left = [n for n in left if n not in group]
    return [_judge(question, found[n]) for n, question in enumerate(questions)]


def _solve_closed(wrist: SphericalWrist, questions: dict[int, Question]) -> dict[int, Postures]:
    """Return postures, whether reached, and dexterity of every question, in closed form on the branches that are sampled."""
    asks = list(questions.values())
    chains = [ask.finger.workspace.chain for ask in asks]
    goals = [
        move_to_base(chain, ask.center + ask.finger.distance * ask.directions, -ask.directions)
        for ask, chain in zip(asks, chains, strict=True)
    ]
    positions, poles = (np.concatenate(part) for part in zip(*goals, strict=True))
    ends = np.cumsum([len(ask.directions) for ask in asks])
    parts = [slice(end - len(ask.directions), end) for ask, end in zip(asks, ends, strict=True)]
    spare = np.full(len(positions), -np.inf)
    postures, reached = np.zeros((6, len(positions))), np.zeros(len(positions), dtype=bool)
    own = [find_sampled_branches(ask.finger.workspace) for ask in asks]
    for branch in dict.fromkeys(branch for branches in own for branch in branches):
        q, exists = wrist.solve(positions, poles, branch)
        margin = np.full(len(positions), -np.inf)
        for part, chain, branches in zip(parts, chains, own, strict=True):
            if branch not in branches:
                continue
            lower, upper = chain.lower[:5, None], chain.upper[:5, None]
            margin[part] = np.minimum(q[:5, part] - lower, upper - q[:5, part]).min(axis=0)
        # The branch that leaves the joints more room.
        better = exists & (margin > spare)
        if better.all():
            postures, reached, spare = q, exists, margin
        else:
            postures[:, better], spare[better] = q[:, better], margin[better]
            reached |= better
    # Not a number where nobody asks: there the joints decide, or it is known.
    dexterity = np.full(len(positions), np.nan)
    limit = np.concatenate([np.full(len(ask.directions), ask.limits.joint_margin) for ask in asks])
    rows = reached & np.isnan(np.concatenate([ask.dexterity for ask in asks])) & (spare > limit - HOPELESS)
    q = postures.T
    if all(ask.tolerance <= CLOSE for ask in asks):
        dexterity[rows] = compute_dexterity(asks[0].finger.workspace.chain, q[rows])
    else:
        dexterity[rows] = wrist.compute_dexterity(postures[:, rows])
    return {
        n: Postures(q[part], reached[part], dexterity[part]) for n, part in zip(questions, parts, strict=True)
    }


def _judge(question: Question, found: Postures) -> Answer:
    """Return what postures (N, J) have to spare."""
    chain, limits = question.finger.workspace.chain, question.limits
    reached = found.is_reached
    dexterity = np.where(np.isnan(question.dexterity), found.dexterity, question.dexterity)
    q = wrap_to_limits(chain, found.q)
    if can_point(chain) or chain.has_tip_roll:
        q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
    margin = np.fmin(compute_joint_margin(chain, q) - limits.joint_margin, dexterity - limits.dexterity)
    # Beyond the last posture the dexterity counts as zero: what is not reached lies behind a singular posture.
    margin = np.where(reached, margin, -max(limits.dexterity, 0.05))
    off = SIGHT - np.arccos(np.clip(question.directions @ question.front, -1.0, 1.0))
    return Answer(q, reached, np.where(reached, dexterity, 0.0), np.minimum(margin, off))
