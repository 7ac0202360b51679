"""What became of a grasp: hold, spin, slip or drop, read off a replay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.sim.judge.replay import Replay
from dexplan.spatial import Array

MOVED, TURNED, SLID = 1e-3, np.radians(1.0), 1e-4
"""A grasp that holds moves the object by less than this [m], turns it by less [rad], and slides by less at each contact [m]."""
AT_LIMIT = 0.98
"""Utilisation of the friction cone from which tangential motion is Coulomb sliding; below it is the simulator's creep."""
AWAY = 0.5
"""An object whose centre ends farther off than this share of its radius is lost, whatever still touches it."""
JUDGED_MOVED, JUDGED_TURNED = 3e-3, np.radians(10.0)
"""How a grasp gave way is judged when the object has moved this far [m] or turned this much [rad]: later it may be anywhere."""


LOST_SAMPLES = 3
"""A contact that is missing in this many samples on end is lost; a tip that slides fast may bounce for one."""
HARD_TORSION = 1e-5
"""Torsional friction [m] of a hard finger: the least that MuJoCo knows.  Torque about the normal then uses no friction."""


class Kind(StrEnum):
    """How a grasp gave way, if it did; :func:`classify` says when it is which."""

    HOLD = "hold"
    SPIN = "spin"
    SLIP = "slip"
    DROP = "drop"


@dataclass(frozen=True)
class Outcome:
    """How an experiment ended, and what was measured.

    ``kind`` is the way in which the grasp gave way, ``is_lost`` whether the object was out of the fingers at the end.  Up to
    the moment of judgement: ``moved_mm`` of the object's centre, ``rotated_deg`` of the object, ``turned_deg`` of that about
    the chord (pairs only), ``slid_mm`` at the friction limit at the worst contact, all as maxima.  ``normal_force_N`` is the
    mean of the contacts at the start; up to the object's leaving, ``utilisation`` is the largest share of a friction cone and
    ``torque_share`` the largest share of a servo's limit; ``touched_other`` whether anything but the fingertips met anything.
    """

    kind: Kind
    is_lost: bool
    moved_mm: float
    rotated_deg: float
    turned_deg: float
    slid_mm: float
    normal_force_N: float
    utilisation: float
    torque_share: float
    touched_other: bool


def classify(replay: Replay, holding: Sequence[int], first: int = 0) -> Outcome:
    """Return what became of the object in the fingers ``holding``, from sample ``first`` on.

    **hold**: up to the end the object's centre moved less than 1 mm, the object turned less than 1 degree, and no contact
    slid by more than 0.1 mm at the limit of its friction cone.  Otherwise the grasp gave way.  How is judged when the object
    has moved by 3 mm or turned by 10 degrees, or at the end if it never did:

    - **drop**: a holding finger has not touched for three samples: the object was pushed out, or fell;
    - **spin**: of two fingers: turning on a fingertip at the limit of friction, the object turned about the chord between
      its contacts by at least 1 degree and a longer way at its surface (radius times angle) than any contact slid over it;
    - **slip**: contacts slid over the object and still touch it (or, with next to no slid way, the servos gave way).
    """
    holding = list(holding)
    world, pose = replay.world, replay.object_pose[first:]
    force = replay.contact_force[first:, holding]
    slip = replay.contact_slip_velocity[first:, holding]
    active = replay.contact_active[first:, holding]
    friction = replay.contact_settings[0] if replay.contact_settings else (1.0, 1.0, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        tangential = np.hypot(force[..., 0], force[..., 1]) / friction[0]
        torsional = force[..., 3] / friction[2] if friction[2] > HARD_TORSION else 0.0
        used = np.hypot(tangential, torsional) / force[..., 2]
    period = float(np.median(np.diff(replay.time)))
    sliding = np.where(active & (used >= AT_LIMIT), np.hypot(slip[..., 0], slip[..., 1]), 0.0)
    slid = np.cumsum(sliding, axis=0).max(axis=1) * period
    spun = (
        np.cumsum(np.where(active & (used >= AT_LIMIT), np.abs(slip[..., 2]), 0.0), axis=0).max(axis=1)
        * period
    )
    moved = np.linalg.norm(pose[:, :3] - pose[0, :3], axis=1)
    attitude = Rotation.from_quat(pose[:, 3:], scalar_first=True)
    vectors: Array = (attitude * attitude[0].inv()).as_rotvec()
    rotated = np.linalg.norm(vectors, axis=1)
    turned = np.zeros_like(rotated)
    if len(holding) == 2:
        points = replay.contact_point_O[first, holding] @ attitude[0].as_matrix().T
        turned = np.abs(vectors @ (points[1] - points[0])) / np.linalg.norm(points[1] - points[0])
    held = ~np.maximum.accumulate(
        (moved >= MOVED) | (rotated >= TURNED) | (slid >= SLID) | ~active.all(axis=1)
    )
    left = int(held.sum())
    far = (moved >= JUDGED_MOVED) | (rotated >= JUDGED_TURNED)
    judged = int(np.argmax(far)) if far.any() else len(pose) - 1
    if held.all():
        kind = Kind.HOLD
    elif not active[max(judged - LOST_SAMPLES + 1, 0) : judged + 1].any(axis=0).all():
        kind = Kind.DROP
    elif (
        spin := min(turned[: judged + 1].max(), spun[judged])
    ) >= TURNED and spin * world.object_radius > slid[judged]:
        kind = Kind.SPIN
    else:
        kind = Kind.SLIP
    until = slice(0, judged + 1)
    return Outcome(
        kind=kind,
        is_lost=bool(not active[-1].all() or moved[-1] > AWAY * world.object_radius),
        moved_mm=1e3 * float(moved[until].max()),
        rotated_deg=float(np.degrees(rotated[until].max())),
        turned_deg=float(np.degrees(turned[until].max())),
        slid_mm=1e3 * float(slid[judged]),
        normal_force_N=float(np.nanmean(force[0, :, 2])),
        utilisation=float(np.nanmax(used[: max(left, 1)])),
        torque_share=float(
            (np.abs(replay.actuator_force[first:][: max(left, 1)]) / world.torque_limit).max()
        ),
        touched_other=any(first <= other.sample <= first + judged for other in replay.other_contacts),
    )
