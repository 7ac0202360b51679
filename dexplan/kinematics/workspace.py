"""Each finger's workspace WS_i: the tip poses its chain can reach, as data of the hand alone [paper §2.1].

The paper assumes a *dextrous* workspace: points that the tip reaches in **any** orientation.  A real chain has next to none
(`dextrous_positions` counts them), so a workspace here keeps what the planner needs instead: for every sampled tip position
and pole direction, a posture, the interval of free spin about the pole, and the distance to the joint limits.  Whether a pose
of interest is reachable is then settled by solving for it exactly, starting from the nearest sampled posture.
"""

from __future__ import annotations

import hashlib
import logging
import os
import zipfile
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from platformdirs import user_cache_dir
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from dexplan.brief import brief_repr
from dexplan.kinematics.chain import Chain, compute_joint_margin, compute_tip_pose, solve_ik, wrap_to_limits
from dexplan.kinematics.finger import FingerDescription
from dexplan.spatial import Array, invert_pose, lock_arrays, make_pose, read_only, rotate_about

_LOG = logging.getLogger(__name__)
VERSION = 1
SPACING = 0.018
"""Distance of sampled tip positions [m]."""
REACH = 0.10
"""Tip positions are sampled this far around the object's home [m]."""
POLES = 96
"""Sampled pole directions."""
HOMOTOPY = 5
"""Stations between the home pose and a sampled one: postures stay on the branch of the home posture."""
LENGTH = 0.06
"""A radian between poles counts as much as this distance [m] in looking up the nearest sample."""


@dataclass(frozen=True, eq=False)
class Workspace:
    """Sampled tip poses of one finger, all reached on the branch of its home posture.

    ``postures`` (N, J) [rad] with the tips at ``positions`` (N, 3) [m] and poles along ``poles`` (N, 3), both in W;
    ``joint_margin`` (N,) [rad] without the spin joint; ``spin`` (N, 2) [rad] how far the tip can be spun either way from the
    sampled posture.  ``dextrous_positions`` counts the sampled positions that are reached with every pole and any spin.
    """

    chain: Chain
    postures: Array
    positions: Array
    poles: Array
    joint_margin: Array
    spin: Array
    dextrous_positions: int
    sampled_positions: int

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(np.hstack([self.positions / LENGTH, self.poles]))

    def solve(self, X_WF: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return postures (N, J) for the tip poses ``X_WF`` (N, 4, 4), and which were reached (N,) whatever the limits.

        Raises ValueError where the workspace is empty.
        """
        if not len(self.postures):
            raise ValueError("the workspace is empty")
        X_WF = np.asarray(X_WF)
        q = self.find_seeds(X_WF[:, :3, 3], X_WF[:, :3, 2])
        if self.chain.has_tip_roll:
            # The seed may point the right way with the wrong spin; the last joint sets that right beforehand.
            R = compute_tip_pose(self.chain, q)[:, :3, :3]
            E = R.swapaxes(1, 2) @ X_WF[:, :3, :3]
            q[:, -1] += self.chain.roll_sign * np.arctan2(E[:, 1, 0] - E[:, 0, 1], E[:, 0, 0] + E[:, 1, 1])
        q, reached = solve_ik(self.chain, X_WF, q, iterations=12)
        return wrap_to_limits(self.chain, q), reached

    def find_seeds(self, positions: Array, poles: Array) -> Array:
        """Return the sampled postures (N, J) nearest to tips at ``positions`` (N, 3) [m] with ``poles`` (N, 3)."""
        _, nearest = self._tree.query(np.hstack([positions / LENGTH, poles]))
        postures: Array = self.postures[nearest].copy()
        return postures

    def moved(self, X_WP: Array) -> Workspace:
        """Return the workspace of the same finger on a palm that stands at ``X_WP`` (4, 4) instead of in W's own axes."""
        X_WP = np.asarray(X_WP, dtype=np.float64)
        offsets = self.chain.offsets.copy()
        offsets[0] = X_WP @ offsets[0]
        return replace(
            self,
            chain=replace(self.chain, offsets=offsets),
            positions=read_only(self.positions @ X_WP[:3, :3].T + X_WP[:3, 3]),
            poles=read_only(self.poles @ X_WP[:3, :3].T),
        )


def load_workspace(finger: FingerDescription, center: Array, X_WP: Array | None = None) -> Workspace:
    """Return the finger's workspace around ``center`` (3,) [m], from the cache outside the repository where it is known.

    ``X_WP`` (4, 4) is the palm's pose, by default where the chain says: WS_i moves with the palm [paper §2.1].  Fingers that
    differ only in where they stand around the vertical through ``center`` share one computation.  The key of the cache holds the
    chain itself, so a changed model is never served with an old workspace.
    """
    if X_WP is not None:
        center_P = (invert_pose(np.asarray(X_WP)) @ np.append(center, 1.0))[:3]
        return load_workspace(finger, center_P).moved(X_WP)
    X_WK = _compute_stand(finger.chain, center)
    offsets = finger.chain.offsets.copy()
    offsets[0] = invert_pose(X_WK) @ offsets[0]
    chain = Chain(offsets, finger.chain.axes, finger.chain.X_JF, finger.chain.lower, finger.chain.upper)
    key = hashlib.sha256()
    for array in (chain.offsets, chain.axes, chain.X_JF, chain.lower, chain.upper, finger.q_home):
        key.update((np.round(array, 7) + 0.0).tobytes())
    key.update(np.array([SPACING, REACH, POLES, HOMOTOPY, VERSION]).tobytes())
    # Set to nothing it means nothing: the folder one stands in is no cache.
    folder = Path(os.environ.get("DEXPLAN_CACHE") or user_cache_dir("dexplan")) / "workspaces"
    path = folder / f"{key.hexdigest()[:32]}.npz"
    if path.is_file():
        try:
            with np.load(path, allow_pickle=False) as stored:
                return _place(finger.chain, X_WK, {name: stored[name] for name in stored.files})
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            path.unlink(missing_ok=True)  # a damaged cache is not worth a word: it is made anew
    _LOG.info("measuring what %s reaches, once for a finger like it", finger.name)
    values = _sample(chain, finger.q_home)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        partial = folder / f".{path.name}.{os.getpid()}"
        with partial.open("wb") as stream:
            np.savez(stream, **values)  # type: ignore[arg-type]
        partial.replace(path)
    except OSError:
        pass  # a cache that cannot be written costs time, not the answer
    return _place(finger.chain, X_WK, values)


def _compute_stand(chain: Chain, center: Array) -> Array:
    """Return the frame K (4, 4) at ``center``, upright, with x towards the finger's first joint."""
    x, y = (chain.offsets[0][:3, 3] - center)[:2]
    return make_pose(rotate_about([0.0, 0.0, 1.0], np.arctan2(y, x)), center)


def _place(chain: Chain, X_WK: Array, values: dict[str, Array]) -> Workspace:
    return Workspace(
        chain,
        postures=read_only(values["postures"]),
        positions=read_only(values["positions"] @ X_WK[:3, :3].T + X_WK[:3, 3]),
        poles=read_only(values["poles"] @ X_WK[:3, :3].T),
        joint_margin=read_only(values["joint_margin"]),
        spin=read_only(values["spin"]),
        dextrous_positions=int(values["counts"][0]),
        sampled_positions=int(values["counts"][1]),
    )


def _sample(chain: Chain, q_home: Array) -> dict[str, Array]:
    """Follow a homotopy of tip poses from home to every sampled position and pole, and keep what stays within the limits."""
    steps = np.arange(-REACH, REACH + 1e-9, SPACING)
    grid = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    positions = grid[np.linalg.norm(grid, axis=1) <= REACH]
    poles = spread_directions(POLES)
    home = compute_tip_pose(chain, q_home)
    p = np.repeat(positions, POLES, axis=0)
    z = np.tile(poles, (len(positions), 1))
    q = np.repeat(q_home[None], len(p), axis=0)
    alive = np.arange(len(p))
    for k in range(1, HOMOTOPY + 1):
        share = k / HOMOTOPY
        X = np.zeros((len(alive), 4, 4))
        X[:, :3, 3] = home[:3, 3] + share * (p[alive] - home[:3, 3])
        X[:, :3, :3] = _swing(home[:3, :3], z[alive], share)
        X[:, 3, 3] = 1.0
        solved, reached = solve_ik(chain, X, q[alive], iterations=8, tolerance=1e-4 if k < HOMOTOPY else 1e-6)
        q[alive] = solved
        # The spin joint may pass its limit on the way: spin is free, and is put right below.
        inside = compute_joint_margin(_without_spin(chain), solved) > (-0.6 if k < HOMOTOPY else 0.0)
        alive = alive[reached & inside]
    q, p, z = q[alive], p[alive], z[alive]
    margin = compute_joint_margin(_without_spin(chain), q)
    if chain.has_tip_roll:
        q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
    spin = np.stack([chain.lower[-1] - q[:, -1], chain.upper[-1] - q[:, -1]], axis=1)
    # Any spin means a whole turn of the last joint; a chain with less has no dextrous point in the paper's sense.
    whole = (spin[:, 1] - spin[:, 0] >= 2.0 * np.pi - 1e-9).all() if len(spin) else False
    _, counts = np.unique(np.round(p, 6), axis=0, return_counts=True) if len(p) else (None, np.zeros(0))
    dextrous = int((counts == POLES).sum()) if whole else 0
    return {
        "postures": q,
        "positions": p,
        "poles": z,
        "joint_margin": margin,
        "spin": spin,
        "counts": np.array([dextrous, len(positions)]),
    }


def _without_spin(chain: Chain) -> Chain:
    if not chain.has_tip_roll:
        return chain
    lower, upper = chain.lower.copy(), chain.upper.copy()
    lower[-1], upper[-1] = -1e9, 1e9
    return Chain(chain.offsets, chain.axes, chain.X_JF, lower, upper)


def _swing(R: Array, z: Array, share: float) -> Array:
    """Return R (3, 3) turned part of the shortest way that brings its third column onto each z (N, 3)."""
    axis = np.cross(R[:, 2], z)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, z @ R[:, 2])
    axis = np.where(sine[:, None] > 1e-9, axis / np.maximum(sine, 1e-12)[:, None], R[:, 0])
    turned: Array = Rotation.from_rotvec((share * angle)[:, None] * axis).as_matrix() @ R
    return turned


def spread_directions(count: int) -> Array:
    """Return ``count`` unit vectors (count, 3) spread evenly over the sphere (Fibonacci lattice)."""
    k = np.arange(count) + 0.5
    polar, azimuth = np.arccos(1.0 - 2.0 * k / count), np.pi * (1.0 + np.sqrt(5.0)) * k
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=1)


def compute_aligned_pose(center: Array, directions: Array, distance: float) -> Array:
    """Return tip poses (N, 4, 4) ``distance`` [m] off ``center`` along ``directions`` (N, 3), poles pointing back at it."""
    X = np.zeros((len(directions), 4, 4))
    X[:, :3, :3] = _build_frames(-directions)
    X[:, :3, 3] = center + distance * directions
    X[:, 3, 3] = 1.0
    return X


def _build_frames(z: Array) -> Array:
    """Return ``spatial.build_frame`` of many unit vectors (N, 3) at once."""
    up = np.zeros_like(z)
    up[:, 2] = 1.0
    y = up - z[:, 2:] * z
    flat = (y * y).sum(axis=1) < 1e-12
    y[flat] = np.array([1.0, 0.0, 0.0]) - z[flat, :1] * z[flat]
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return np.stack([np.cross(y, z), y, z], axis=-1)
