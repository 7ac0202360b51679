"""Contacts of fingers that roll: landed at one stop of the object's way, and carried along all that is left of it.

Where a carried contact is depends on where and when it landed, and on nothing else: every touch is carried once, many of them
together, and looked up from then on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from dexplan.contact.bodies.sites import Sites
from dexplan.kinematics.carry import Carried, Carrier, CarryEnd, carry_fixed, carry_rolling
from dexplan.kinematics.chain import compute_joint_margin, compute_tip_jacobian
from dexplan.kinematics.land import land
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.rolling_hold import TouchState
from dexplan.planning.contacts.track import Track
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.spatial import Array, lock_arrays

ENDS = {
    CarryEnd.JOINT: RefusalKind.JOINT_LIMIT,
    CarryEnd.POLE: RefusalKind.TIP_POLE,
    CarryEnd.EDGE: RefusalKind.OUT_OF_REACH,
    CarryEnd.SINGULAR: RefusalKind.SINGULAR,
    CarryEnd.REACH: RefusalKind.OUT_OF_REACH,
    CarryEnd.PIVOT: RefusalKind.TIP_ROTATION,
}
"""Why a finger cannot carry on, by what ended its carry."""

STEP = float(np.radians(2.01))
"""Longest turn of the object in one step of a carry [rad]: over 118 degrees contacts of TriFinger are off by 7 um at most."""
PIECE = 15
"""So many stations on the ways of contacts are looked at before it is asked whether any of them still goes on."""


@dataclass(frozen=True, eq=False)
class CarriedBatch:
    """Touches of one finger that landed together: ``carried`` from station ``first`` on, with Jacobians ``J`` (K, N, 6, J)."""

    finger: int
    first: int
    carried: Carried
    J: Array

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(frozen=True)
class RollingTouch:
    """One touch: a row of its ``batch``; held from the stop ``landed`` on, and within all limits up to the stop ``until``."""

    batch: CarriedBatch
    row: int
    landed: int
    until: int

    @property
    def finger(self) -> int:
        """The finger that touches."""
        return self.batch.finger

    def at(self, station: int) -> TouchState:
        """Return the contact at a station of the way."""
        batch = self.batch
        k, found = station - batch.first, batch.carried
        return TouchState(
            batch.finger,
            found.q[k, self.row],
            batch.J[k, self.row],
            found.p_O[k, self.row],
            found.n_O[k, self.row],
            found.X_OF[k, self.row],
        )

    def get_pivot(self, station: int) -> float:
        """Return how far [rad] the tip has turned about the outward normal since it landed."""
        return float(self.batch.carried.pivot[station - self.batch.first, self.row])

    def refuse(self, name: str) -> Refusal:
        """Return why the finger, called ``name``, carries no farther."""
        return Refusal(ENDS[self.batch.carried.ends[self.row]], (name,))


@dataclass(eq=False)
class RollingTouches:
    """All touches of a hand along the object's ``track``; answers are kept.

    *Stations* are the poses that are looked at; every stop of the track is one.  ``rolls``: whether contacts roll, else tip poses
    stay fixed on the object, which takes six joints.
    """

    hand: HandModel
    carriers: tuple[Carrier, ...]
    track: Track
    sites: Sites
    rolls: bool = True
    touches: list[RollingTouch] = field(default_factory=list, init=False)
    _landed: dict[tuple[int, int, int], tuple[int, ...]] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        rows = [step.poses() for step in self.track.steps]
        self.stations = np.concatenate([self.track.poses[0][None], *(poses[1:] for poses in rows)])
        """Poses (K, 4, 4) of the object."""
        self.stops = np.cumsum([0, *(len(poses) - 1 for poses in rows)])
        """The station of every stop (S,)."""
        self._step_of = np.repeat(np.arange(len(rows)), [len(poses) - 1 for poses in rows])

    @property
    def last(self) -> int:
        """The number of the last stop."""
        return len(self.stops) - 1

    def compute_twist(self, station: int) -> Array:
        """Return the object's twist (6,) on from a station, of any size: velocity in units of 60 mm, angular velocity; W."""
        if not len(self._step_of):
            return np.zeros(6)
        step = self.track.steps[self._step_of[min(station, len(self._step_of) - 1)]]
        return np.concatenate([step.shift_W / 0.06, step.angle * step.axis_W])

    def add(self, finger: int, stop: int, postures: Array) -> tuple[int, ...]:
        """Note touches of a finger at a stop in postures (N, J) that touch the object; return the numbers of those that hold."""
        first = int(self.stops[stop])
        carrier, poses = self.carriers[finger], self.stations[first:]
        carried = self._carry(carrier, postures, poses)
        batch = CarriedBatch(finger, first, carried, compute_tip_jacobian(carrier.chain, carried.q))
        begin = len(self.touches)
        for row, until in enumerate(carried.until):
            if until >= 0:
                end = int(np.searchsorted(self.stops, first + until, side="right")) - 1
                self.touches.append(RollingTouch(batch, row, stop, end))
        return tuple(range(begin, len(self.touches)))

    def _carry(self, carrier: Carrier, postures: Array, poses: Array) -> Carried:
        """Carry postures (N, J) along poses (K, 4, 4), as far as any of them gets; one piece of the way after the other."""
        carry = partial(carry_rolling, step=STEP) if self.rolls else carry_fixed
        whole = carry(carrier, self.hand.object.body, postures, poses[: PIECE + 1])
        while (done := len(whole.q) - 1) < len(poses) - 1 and (going := whole.until == done).any():
            more = carry(carrier, self.hand.object.body, whole.q[-1], poses[done : done + PIECE + 1])
            joined = {
                name: np.concatenate([getattr(whole, name), getattr(more, name)[1:]])
                for name in ("q", "p_O", "n_O", "X_OF")
            }
            ends = [m if g else w for m, w, g in zip(more.ends, whole.ends, going, strict=True)]
            whole = Carried(
                **joined,
                pivot=np.concatenate([whole.pivot, whole.pivot[-1] + more.pivot[1:]]),
                until=np.where(going, done + np.maximum(more.until, 0), whole.until),
                ends=tuple(ends),
            )
        return whole

    def land(self, finger: int, stop: int, sites: Sequence[int]) -> list[int]:
        """Return the touches of a finger that lands on some of the sites at a stop, all branches of its postures."""
        missing = [site for site in sites if (finger, stop, site) not in self._landed]
        if missing:
            X_WO, rows = self.track.poses[stop], np.array(missing)
            points = self.sites.points[rows] @ X_WO[:3, :3].T + X_WO[:3, 3]
            normals = self.sites.normals[rows] @ X_WO[:3, :3].T
            found = land(self.carriers[finger], points, normals)
            begin = len(self.touches)
            numbers = self.add(finger, stop, found.q) if len(found) else ()
            rows_of = {self.touches[n].row: n for n in numbers if n >= begin}
            for k, site in enumerate(missing):
                there = [rows_of[row] for row in np.flatnonzero(found.site == k).tolist() if row in rows_of]
                self._landed[finger, stop, site] = tuple(there)
        return [touch for site in sites for touch in self._landed[finger, stop, site]]

    def land_at(self, finger: int, normal_O: Array) -> int | None:
        """Return the touch of a finger at the first stop where a ray along ``normal_O`` (3,) leaves the body; None out of reach.

        Of several branches the one farthest from the joints' limits.
        """
        body, X_WO, carrier = self.hand.object.body, self.track.poses[0], self.carriers[finger]
        point = body.radial(normal_O)
        normal_W = X_WO[:3, :3] @ body.normal_at(point)
        found = land(carrier, (X_WO[:3, :3] @ point + X_WO[:3, 3])[None], normal_W[None])
        if not len(found):
            return None
        best = int(np.argmax(compute_joint_margin(carrier.chain, found.q)))
        return next(iter(self.add(finger, 0, found.q[best : best + 1])), None)
