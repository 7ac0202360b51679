"""A rolling path: a fingertip that rolls on a body, sampled so that a controller can follow it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dexplan.brief import brief_repr
from dexplan.contact.rolling.turning import build_turn, split_turn
from dexplan.spatial import Array, read_only


@dataclass(frozen=True, eq=False)
class RollingPath:
    """A tip rolling on a body without sliding or spin, at K samples.

    Frames: O the body's, F the tip's (origin at its centre, z its pole).

    ``n_O`` (K, 3): where the contact is on the body, as the body's **outward** unit normal, in O.
    ``n_F`` (K, 3): where it is on the tip, as the tip's outward unit normal, in F: ``R_OF @ n_F == -n_O``.
    ``X_OF`` (K, 4, 4): the tip's pose.
    ``p_O``, ``p_F`` (K, 3): the contact points [m], in O and in F.
    ``length`` (K,): arc length [m] from the start, on the body and, because it rolls, on the tip alike.
    ``corners`` (L + 1,): the samples at which legs start and end.
    """

    n_O: Array
    n_F: Array
    X_OF: Array
    p_O: Array
    p_F: Array
    length: Array
    corners: NDArray[np.intp]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name in ("n_O", "n_F", "X_OF", "p_O", "p_F", "length"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        corners = np.array(self.corners, dtype=np.intp)
        corners.setflags(write=False)
        object.__setattr__(self, "corners", corners)

    def __len__(self) -> int:
        return len(self.length)

    @property
    def total_length(self) -> float:
        """Arc length of the whole path [m]."""
        return float(self.length[-1])

    @property
    def polar_angle(self) -> Array:
        """Angle (K,) [rad] between the tip's pole, z of F, and the contact on the tip."""
        return np.arctan2(np.hypot(self.n_F[:, 0], self.n_F[:, 1]), self.n_F[:, 2])

    @property
    def waypoints(self) -> Array:
        """Contacts (L, 3) on the body where legs end: with X_OF[0] all that ``roll_along`` needs to roll this path on spheres,
        as long as no leg is half a turn or more of the ball.
        """
        return self.n_O[self.corners[1:]]

    @property
    def reversed(self) -> RollingPath:
        """The way back."""
        return RollingPath(
            n_O=self.n_O[::-1],
            n_F=self.n_F[::-1],
            X_OF=self.X_OF[::-1],
            p_O=self.p_O[::-1],
            p_F=self.p_F[::-1],
            length=self.total_length - self.length[::-1],
            corners=len(self) - 1 - self.corners[::-1],
        )

    def pose_at(self, length: ArrayLike) -> Array:
        """Return X_OF (..., 4, 4) at arc lengths (...) [m], held at the ends.

        Between samples the tip turns about a fixed axis and its centre runs on a circle about O: exact for spheres, second
        order in the spacing for others.
        """
        s = np.clip(np.asarray(length, dtype=np.float64), 0.0, self.total_length)
        k = np.clip(np.searchsorted(self.length, s, side="right") - 1, 0, len(self) - 2)
        span = self.length[k + 1] - self.length[k]
        share = np.where(span > 0.0, (s - self.length[k]) / np.where(span > 0.0, span, 1.0), 0.0)
        R_0, R_1 = self.X_OF[k, :3, :3], self.X_OF[k + 1, :3, :3]
        X = np.zeros((*s.shape, 4, 4))
        X[..., 3, 3] = 1.0
        axis, angle = split_turn(R_1 @ np.swapaxes(R_0, -1, -2))
        X[..., :3, :3] = build_turn(axis, share * angle) @ R_0
        p_0, p_1 = self.X_OF[k, :3, 3], self.X_OF[k + 1, :3, 3]
        far_0, far_1 = (np.linalg.norm(p, axis=-1, keepdims=True) for p in (p_0, p_1))
        e_0, e_1 = p_0 / far_0, p_1 / far_1
        arc = np.arctan2(np.linalg.norm(np.cross(e_0, e_1), axis=-1), np.sum(e_0 * e_1, axis=-1))[..., None]
        w, sine = share[..., None], np.where(arc > 1e-9, np.sin(arc), 1.0)
        on_circle = (np.sin((1.0 - w) * arc) * e_0 + np.sin(w * arc) * e_1) / sine
        e = np.where(arc > 1e-9, on_circle, (1.0 - w) * e_0 + w * e_1)
        X[..., :3, 3] = ((1.0 - w) * far_0 + w * far_1) * e
        return X


def join_paths(paths: Sequence[RollingPath]) -> RollingPath:
    """Return one path of several, each of which starts where the one before ended; raises ValueError where one does not."""
    for before, after in pairwise(paths):
        if not np.allclose(before.X_OF[-1], after.X_OF[0], atol=1e-9):
            raise ValueError(
                "a path starts elsewhere than the one before ends; paths without a lift between are accepted"
            )
    keep = [slice(0 if i == 0 else 1, None) for i in range(len(paths))]
    offsets = np.concatenate([[0.0], np.cumsum([p.total_length for p in paths])])
    firsts = np.concatenate([[0], np.cumsum([len(p) - 1 for p in paths])])
    stacked = {
        name: np.concatenate([getattr(p, name)[k] for p, k in zip(paths, keep, strict=True)])
        for name in ("n_O", "n_F", "X_OF", "p_O", "p_F")
    }
    return RollingPath(
        **stacked,
        length=np.concatenate([p.length[k] + o for p, k, o in zip(paths, keep, offsets, strict=False)]),
        corners=np.concatenate([p.corners[k] + f for p, k, f in zip(paths, keep, firsts, strict=False)]),
    )
