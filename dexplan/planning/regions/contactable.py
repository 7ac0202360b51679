"""Where on the object can one finger touch?  CWS_i as a signed field over the directions from the object's centre.

A finger touches along an outward normal n when its tip's pole points along -n (the spin about the pole is free: the last joint
turns it).  That leaves five equations for the other joints.  The field is the smallest of what the finger then has to spare:
joint range, dexterity, and the angle to the border of what lies before the finger; its zero level is the border of CWS_i.
A finger with a spherical wrist is answered in closed form, any other by Newton steps from sampled postures.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from dexplan.icosphere import Icosphere, build_icosphere
from dexplan.kinematics.chain import compute_dexterity, compute_joint_margin, wrap_to_limits
from dexplan.kinematics.pointing import can_point, is_same_finger, move_to_base, solve_pointing
from dexplan.kinematics.spherical_wrist import SphericalWrist, find_sampled_branches, find_spherical_wrist
from dexplan.kinematics.workspace import Workspace, compute_aligned_pose
from dexplan.planning.regions.spherical import FINE, LevelSet
from dexplan.spatial import Array, lock_arrays, read_only

COARSE = 3
"""Level of the grid at which every direction before the finger is asked; those near the border are asked down to the finest."""
SIGHT = float(np.radians(85.0))
"""Directions farther than this from the finger's own are not tried."""
NEAR = 0.02
"""Values nearer to zero than this may hide a border between them [rad]."""
DEXTERITY_CHANGE = 0.06
"""With this much dexterity beyond its limit it does not fall below it within a triangle: it changes slower than the direction."""
FIRST_STEP_ERROR = 5e-3
"""A Newton step from this far off leaves about a hundredth of it."""
CLIFF = 0.15
"""A margin this far below zero next to one above it is taken for another branch [rad]."""
PASSES = 2
"""Rounds per level in which a border that runs on into triangles not asked about is followed."""
CLOSE = 1e-5
"""Tolerance of exact answers."""
HOPELESS = 0.15
"""Where the joints are this far beyond what they may, nobody asks for the dexterity [rad]."""
_JUMP = 0.5
"""Postures of neighbours that differ more than this lie on different branches [rad]."""


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
    home: tuple[float, float, float]
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


Answer = tuple[Array, Array, NDArray[np.bool_], Array]
"""Field (N,) [rad], postures (N, J), whether these touch (N,), and their dexterity (N,)."""


@dataclass(frozen=True, eq=False)
class Contactable:
    """CWS_i of one finger on a sphere at one position, over the directions of ``grid``, in the axes of the workspace.

    ``margin`` (V,) is the field [rad], positive inside; values far from its zero level are interpolated.  ``postures`` (V, J)
    [rad] touch at the vertices of ``is_solved`` (V,); a finger in closed form keeps none.  ``front`` (3,) is the finger's own
    direction.
    """

    grid: Icosphere
    finger: Toucher
    limits: ContactLimits
    center: Array
    front: Array
    margin: Array
    postures: Array
    is_solved: NDArray[np.bool_]

    def __post_init__(self) -> None:
        lock_arrays(self)

    def compute_margin(self, directions: Array) -> Array:
        """Return the field (N,) [rad] at unit vectors (N, 3) exactly: the inverse kinematics is solved there."""
        margin = np.full(len(directions), -SIGHT)
        near = np.flatnonzero(directions @ self.front > np.cos(SIGHT))
        workspace = self.finger.workspace
        if find_spherical_wrist(workspace.chain) is not None:
            if len(near) and len(workspace.postures):
                margin[near] = self._ask(directions[near], np.zeros((len(near), workspace.chain.n_joints)))
            return margin
        if len(near) and len(self._solved):
            d = directions[near]
            seeds = self.postures[self._solved[np.argmax(d @ self._solved_vertices, axis=1)]]
            margin[near] = self._ask(d, seeds)
            # Where that does not touch, the nearest sampled posture may lead to another branch.
            rows = near[margin[near] < 0.0]
            if len(rows):
                d = directions[rows]
                seeds = workspace.find_seeds(self.center + self.finger.distance * d, -d)
                margin[rows] = np.maximum(margin[rows], self._ask(d, seeds))
        return margin

    def _ask(self, directions: Array, seeds: Array) -> Array:
        unknown = np.full(len(directions), np.nan)
        question = Question(
            self.finger, self.limits, self.center, self.front, directions, seeds, 12, CLOSE, unknown
        )
        return _answer([question])[0][0]

    @cached_property
    def _solved(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.is_solved)

    @cached_property
    def _solved_vertices(self) -> Array:
        return read_only(self.grid.vertices[self._solved].T)


@lru_cache(maxsize=24)
def compute_contactable(
    fingers: tuple[Toucher, ...], limits: ContactLimits, center: tuple[float, float, float]
) -> tuple[LevelSet, ...]:
    """Return CWS_i of every finger on a sphere about ``center`` (3,) [m], in the axes of the workspaces; the last are kept."""
    # Every finger's grid is refined by itself; their questions are answered together.
    work = [
        (_refine if find_spherical_wrist(finger.workspace.chain) is None else _refine_closed)(
            finger, limits, np.array(center)
        )
        for finger in fingers
    ]
    asked = dict(enumerate(map(next, work)))
    done: dict[int, Contactable] = {}
    while asked:
        answers = _answer([q for q in asked.values() if q is not None])
        given = iter(answers)
        for i, question in list(asked.items()):
            try:
                asked[i] = work[i].send(None if question is None else next(given))
            except StopIteration as end:
                done[i] = end.value
                del asked[i]
    return tuple(LevelSet(done[i].grid, done[i].margin, done[i].compute_margin) for i in range(len(fingers)))


def _refine(
    finger: Toucher, limits: ContactLimits, center: Array
) -> Generator[Question | None, Answer | None, Contactable]:
    """Build the field of one finger from coarse to fine; yields questions (None for nothing to ask), is sent the answers."""
    grid, workspace = build_icosphere(COARSE), finger.workspace
    front = np.array(finger.home) - center
    front /= np.linalg.norm(front)
    margin = SIGHT - np.arccos(np.clip(grid.vertices @ front, -1.0, 1.0))
    q = np.zeros((len(margin), workspace.chain.n_joints))
    solved, exact = np.zeros(len(margin), dtype=bool), margin < -1.2 * grid.spacing
    seeded, dexterity, far = solved.copy(), np.zeros(len(margin)), exact.copy()
    if not len(workspace.postures):
        yield None  # nothing is reached, so there is nothing to ask
        grid = build_icosphere(FINE)
        count = len(grid.vertices)
        nowhere, none = np.full(count, -SIGHT), np.zeros(count, dtype=bool)
        return Contactable(grid, finger, limits, center, front, nowhere, np.zeros((count, q.shape[1])), none)

    def ask(rows: NDArray[np.intp]) -> Question:
        directions = grid.vertices[rows]
        seeds, bare = q[rows], ~seeded[rows]
        touching = np.flatnonzero(solved & (margin > 0.0))
        if len(touching):
            # Newton steps from a sample may have failed, or ended on another branch, where a neighbour's posture leads on.
            nearest = np.argmax(directions[bare] @ grid.vertices[touching].T, axis=1)
            seeds[bare] = q[touching[nearest]]
        else:
            seeds[bare] = workspace.find_seeds(center + finger.distance * directions[bare], -directions[bare])
        # Coarse values only guide; what lies beside the border is asked again, closely, at the last level.
        iterations, tolerance = 7 if level == COARSE else 3, 3e-4 if level == FINE else 1e-2
        known = np.full(len(rows), np.nan)
        if level > COARSE:
            # Between far from singular postures it stays so: what decides is the joints.
            plain = seeded[rows] & (dexterity[rows] > limits.dexterity + DEXTERITY_CHANGE)
            known[plain] = dexterity[rows][plain]
        return Question(finger, limits, center, front, directions, seeds, iterations, tolerance, known)

    for level in range(COARSE, FINE + 1):
        if level > COARSE:
            grid = build_icosphere(level)
            a, b = grid.parents.T
            joined = solved[a] & solved[b] & (np.abs(q[a] - q[b]).max(axis=1) < _JUMP)
            middle = np.where(joined[:, None], 0.5 * (q[a] + q[b]), np.where(solved[a, None], q[a], q[b]))
            seeded = np.concatenate([solved, solved[a] | solved[b]])
            margin, dexterity, q = grid.extend(margin), grid.extend(dexterity), np.concatenate([q, middle])
            solved = np.concatenate([solved, np.zeros(len(a), dtype=bool)])
            exact = grid.vertices @ front < np.cos(SIGHT + 1.2 * grid.spacing)
            far = exact.copy()
        for round_ in range(PASSES + 1):
            # The first level asks everywhere, the others in triangles that a border may cross.
            rows = np.flatnonzero(~exact & (True if level == COARSE else grid.find_crossed(margin, NEAR)))
            is_last = not len(rows) or round_ == PASSES
            if is_last:
                # Beside what touches, margins do not fall off a cliff: ask again from a posture that touches.
                steep = 0.0 if level == COARSE else -CLIFF
                rows = np.flatnonzero(grid.find_crossed(margin, 0.0) & (margin < steep) & ~far)
                seeded[rows] = False
            if len(rows):
                answer = yield ask(rows)
                assert answer is not None
                better = answer[0] > margin[rows] if is_last else np.ones(len(rows), dtype=bool)
                rows = rows[better]
                margin[rows], q[rows], solved[rows], dexterity[rows] = (part[better] for part in answer)
                exact[rows] = True
            if is_last:
                break
    return Contactable(
        grid, finger, limits, read_only(center), read_only(front), read_only(margin), read_only(q), solved
    )  # fmt: skip


def _refine_closed(
    finger: Toucher, limits: ContactLimits, center: Array
) -> Generator[Question | None, Answer | None, Contactable]:
    """Build the field of a finger that needs no postures to start from; as :func:`_refine`."""
    grid, joints = build_icosphere(COARSE), finger.workspace.chain.n_joints
    front = np.array(finger.home) - center
    front /= np.linalg.norm(front)
    margin = SIGHT - np.arccos(np.clip(grid.vertices @ front, -1.0, 1.0))
    dexterity = np.full(len(margin), np.nan)
    exact = margin < -1.2 * grid.spacing
    if not len(finger.workspace.postures):
        yield None  # nothing is reached, so there is nothing to ask
        margin, exact = np.full(len(build_icosphere(FINE).vertices), -SIGHT), exact[:0]
    for level in range(COARSE, FINE + 1) if len(exact) else ():
        if level > COARSE:
            grid = build_icosphere(level)
            margin, dexterity = grid.extend(margin), grid.extend(dexterity)
            exact = grid.vertices @ front < np.cos(SIGHT + 1.2 * grid.spacing)
        # The first level asks everywhere, the others in triangles that a border may cross, and then where it runs on.
        for _ in range(1 if level == COARSE else PASSES):
            rows = np.flatnonzero(~exact & (True if level == COARSE else grid.find_crossed(margin, NEAR)))
            if not len(rows):
                break
            # Between far from singular postures it stays so: what decides is the joints.
            known = dexterity[rows]
            known[~(known > limits.dexterity + DEXTERITY_CHANGE)] = np.nan
            answer = yield Question(
                finger, limits, center, front, grid.vertices[rows], np.zeros((len(rows), joints)), 1, 1.0, known
            )  # fmt: skip
            assert answer is not None
            margin[rows], _, _, dexterity[rows] = answer
            exact[rows] = True
    grid, count = build_icosphere(FINE), len(margin)
    return Contactable(
        grid, finger, limits, read_only(center), read_only(front), read_only(margin),
        np.zeros((0, joints)), np.zeros(count, dtype=bool),
    )  # fmt: skip


def _answer(questions: list[Question]) -> list[Answer]:
    """Answer questions; those of equal fingers, wherever they stand, in one go."""
    found: dict[int, tuple[Array, NDArray[np.bool_], Array]] = {}
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
                found[n] = (parts[0], parts[1], parts[2])
        else:
            for n in group:
                ask = questions[n]
                X_WF = compute_aligned_pose(ask.center, ask.directions, ask.finger.distance)
                q, reached = ask.finger.workspace.solve(X_WF)
                found[n] = (q, reached, compute_dexterity(ask.finger.workspace.chain, q))
        left = [n for n in left if n not in group]
    return [_judge(question, *found[n]) for n, question in enumerate(questions)]


def _solve_closed(
    wrist: SphericalWrist, questions: dict[int, Question]
) -> dict[int, tuple[Array, NDArray[np.bool_], Array]]:
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
    return {n: (q[part], reached[part], dexterity[part]) for n, part in zip(questions, parts, strict=True)}


def _judge(question: Question, q: Array, reached: NDArray[np.bool_], dexterity: Array) -> Answer:
    """Return what postures (N, J) have to spare."""
    chain, limits = question.finger.workspace.chain, question.limits
    dexterity = np.where(np.isnan(question.dexterity), dexterity, question.dexterity)
    q = wrap_to_limits(chain, q)
    if can_point(chain) or chain.has_tip_roll:
        q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
    margin = np.fmin(compute_joint_margin(chain, q) - limits.joint_margin, dexterity - limits.dexterity)
    # Beyond the last posture the dexterity counts as zero: what is not reached lies behind a singular posture.
    margin = np.where(reached, margin, -max(limits.dexterity, 0.05))
    off = SIGHT - np.arccos(np.clip(question.directions @ question.front, -1.0, 1.0))
    return np.minimum(margin, off), q, reached, np.where(reached, dexterity, 0.0)
