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
from dexplan.kinematics.spherical_wrist import find_spherical_wrist
from dexplan.planning.regions.spherical import FINE, LevelSet
from dexplan.planning.regions.touching import (
    CLOSE,
    SIGHT,
    Answer,
    ContactLimits,
    Question,
    Toucher,
    answer,
)
from dexplan.spatial import Array, lock_arrays, read_only

COARSE = 3
"""Level of the grid at which every direction before the finger is asked; those near the border are asked down to the finest."""
NEAR = 0.02
"""Values nearer to zero than this may hide a border between them [rad]."""
DEXTERITY_CHANGE = 0.06
"""With this much dexterity beyond its limit it does not fall below it within a triangle: it changes slower than the direction."""
CLIFF = 0.15
"""A margin this far below zero next to one above it is taken for another branch [rad]."""
PASSES = 2
"""Rounds per level in which a border that runs on into triangles not asked about is followed."""
_JUMP = 0.5
"""Postures of neighbours that differ more than this lie on different branches [rad]."""


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
        return answer([question])[0].margin

    @cached_property
    def _solved(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.is_solved)

    @cached_property
    def _solved_vertices(self) -> Array:
        return read_only(self.grid.vertices[self._solved].T)


@lru_cache(maxsize=24)
def compute_contactable(
    fingers: tuple[Toucher, ...], limits: ContactLimits, center: tuple[float, ...]
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
        answers = answer([q for q in asked.values() if q is not None])
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
                found = yield ask(rows)
                assert found is not None
                better = found.margin > margin[rows] if is_last else np.ones(len(rows), dtype=bool)
                rows = rows[better]
                margin[rows], q[rows] = found.margin[better], found.q[better]
                solved[rows], dexterity[rows] = found.is_reached[better], found.dexterity[better]
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
            found = yield Question(
                finger, limits, center, front, grid.vertices[rows], np.zeros((len(rows), joints)), 1, 1.0, known
            )  # fmt: skip
            assert found is not None
            margin[rows], dexterity[rows] = found.margin, found.dexterity
            exact[rows] = True
    grid, count = build_icosphere(FINE), len(margin)
    return Contactable(
        grid, finger, limits, read_only(center), read_only(front), read_only(margin),
        np.zeros((0, joints)), np.zeros(count, dtype=bool),
    )  # fmt: skip
