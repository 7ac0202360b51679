"""What `inspect` asks about a hand: its regions on the object, and what every pair of fingers can carry."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.kinematics.chain import compute_joint_margin
from dexplan.kinematics.workspace import compute_aligned_pose
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.separation import compute_pair_angle_max
from dexplan.planning.regions.regions import Regions, compute_regions
from dexplan.plans.refusal import RefusalCount
from dexplan.spatial import Array, angles_from_direction, direction_from_angles, lock_arrays

STATION_DEG = 6.0
"""Spacing of the placements on the equator whose loads are computed."""
PLACEMENTS = 120
"""At most so many placements per pair are asked about, spread over their angles."""
BELOW_DEG = 8.0
"""Pairs this far below the smallest force-closed angle are still asked about, to show where the load gives out."""


@dataclass(frozen=True, eq=False)
class PairLoads:
    """Two fingers holding the object at home, the others at home: one row per placement of both on the equator.

    ``angle`` (N,) between the outward normals [rad]; ``load`` (N,) share of the believed cone left, ``torque`` (N,) largest
    share of a torque limit, both NaN where nothing carries the load; ``is_admissible`` (N,); ``refusals`` counts the others
    by reason.
    """

    fingers: tuple[int, int]
    angle: Array
    load: Array
    torque: Array
    is_admissible: NDArray[np.bool_]
    refusals: dict[str, int]

    __repr__ = brief_repr


@dataclass(frozen=True, eq=False)
class Reach:
    """All that the picture and the text of a hand are made from; ``azimuths`` (F,) are the fingers' own [deg]."""

    regions: Regions
    azimuths: Array
    phi_min: float
    loads: tuple[PairLoads, ...]

    __repr__ = brief_repr


@lru_cache(maxsize=1)
def compute_reach(hand: HandModel) -> Reach:
    """Return regions and pair loads of ``hand`` with the object at home; the last hand's are kept."""
    center = hand.object.X_WO_home[:3, 3]
    home = np.stack([finger.pose_at(finger.q_home)[:3, 3] - center for finger in hand.fingers])
    azimuths, _ = angles_from_direction(home / np.linalg.norm(home, axis=1, keepdims=True))
    phi_min = math.pi - 2.0 * compute_pair_angle_max(hand.friction)
    stations = [_find_stations(hand, i) for i in range(len(hand.fingers))]
    judge = Admissibility(hand)
    return Reach(
        regions=compute_regions(hand, hand.object.X_WO_home, allowed=hand.object.allowed_regions),
        azimuths=azimuths,
        phi_min=phi_min,
        loads=tuple(
            _compute_pair(hand, judge, pair, stations, phi_min)
            for pair in combinations(range(len(hand.fingers)), 2)
        ),
    )


def _find_stations(hand: HandModel, finger: int) -> tuple[Array, Array]:
    """Return the equatorial normals (K, 3) that a finger reaches and may touch along, and its postures there (K, J)."""
    description, workspace = hand.fingers[finger], hand.workspaces[finger]
    normals = direction_from_angles(azimuth := np.arange(0.0, 360.0, STATION_DEG), np.zeros_like(azimuth))
    radius = float(np.linalg.norm(hand.object.surface.radial(normals[0])))
    if not len(workspace.postures):
        return normals[:0], np.zeros((0, description.chain.n_joints))
    X_WF = compute_aligned_pose(hand.object.X_WO_home[:3, 3], normals, radius + description.tip_radius)
    q, reached = workspace.solve(X_WF)
    if description.chain.has_tip_roll:
        q[:, -1] = 0.5 * (description.chain.lower[-1] + description.chain.upper[-1])
    reached &= compute_joint_margin(description.chain, q) >= hand.limits.joint_margin
    # What no contact may be made at says nothing about what the pair can carry.
    reached &= hand.object.allows(normals @ hand.object.X_WO_home[:3, :3])
    return normals[reached], q[reached]


def _compute_pair(
    hand: HandModel,
    judge: Admissibility,
    pair: tuple[int, int],
    stations: list[tuple[Array, Array]],
    phi_min: float,
) -> PairLoads:
    (normals_i, q_i), (normals_j, q_j) = (stations[f] for f in pair)
    angles = np.arccos(np.clip(normals_i @ normals_j.T, -1.0, 1.0))
    rows = np.argwhere(angles >= phi_min - math.radians(BELOW_DEG))
    rows = rows[np.argsort(angles[tuple(rows.T)], kind="stable")]
    if len(rows) > PLACEMENTS:
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, PLACEMENTS).round().astype(int))]
    judged = judge_placements(hand, judge, pair, np.stack([q_i[rows[:, 0]], q_j[rows[:, 1]]], axis=1))
    return PairLoads(
        fingers=pair,
        angle=angles[tuple(rows.T)],
        load=judged.load,
        torque=judged.torque,
        is_admissible=judged.is_admissible,
        refusals=judged.refusals,
    )


@dataclass(frozen=True, eq=False)
class Judged:
    """What N placements of a pair leave to spare: ``load`` and ``torque`` (N,), NaN where there are no forces, whether each
    ``is_admissible`` (N,), and how often each refusal was met.
    """

    load: Array
    torque: Array
    is_admissible: NDArray[np.bool_]
    refusals: dict[str, int]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def judge_placements(hand: HandModel, judge: Admissibility, pair: tuple[int, int], postures: Array) -> Judged:
    """Return the judgement of placements of two fingers with ``postures`` (N, 2, J) [rad], the object and all others at home."""
    margins, refusals = [], RefusalCount()
    for both in postures:
        q = hand.q_home.copy()
        q[list(pair)] = both
        margins.append(m := judge.compute_margins(q, hand.object.X_WO_home, pair))
        if m.refusal is not None:
            refusals.add(m.refusal)
    load, torque = np.array([(m.load, m.torque) for m in margins]).reshape(-1, 2).T
    return Judged(
        np.where(np.isfinite(load), load, np.nan),
        np.where(np.isfinite(torque), torque, np.nan),
        np.array([m.is_admissible for m in margins], dtype=bool),
        {str(r.without_numbers): count for r, count in refusals.counts},
    )
