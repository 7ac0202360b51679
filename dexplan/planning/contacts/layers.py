"""Poses on the object's way at which fingers may be relocated, and how contacts are carried from one to the next."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from dexplan.planning.admissible.admissibility import Admissibility, FingerState, compute_finger_states, worst
from dexplan.planning.admissible.carry import follow_object, judge_carry
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.loads import compute_object_wrench
from dexplan.planning.contacts.landings import FACING
from dexplan.planning.contacts.oracle import Verdict
from dexplan.planning.contacts.still import Stand, StillContacts
from dexplan.planning.contacts.track import Track
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.refusal import Refusal
from dexplan.spatial import Array

SLACK = 1.02
"""The quick answer searches on a grid: a pair does not hold for sure only beyond this."""


@dataclass(frozen=True, eq=False)
class CarriedSpot:
    """A contact on its way to the next layer: the spot ``there``, and the finger's ``states`` on the way.

    ``there`` is None where it cannot be carried that far; ``refusal`` says why.
    """

    there: int | None
    states: tuple[FingerState, ...] = ()
    refusal: Refusal | None = None


@dataclass(eq=False)
class Layers:
    """The contacts at every stop of the object's ``track``; one pose where it stands still.

    ``looks_ahead``: tips land with the spin that the carry ahead asks for.  ``facing``: as in :func:`.landings.find_facing`.
    """

    hand: HandModel
    admissibility: Admissibility
    track: Track
    looks_ahead: bool = False
    facing: float = FACING
    poses: list[StillContacts] = field(default_factory=list)
    _promises: dict[tuple[int, int, int], Array] = field(default_factory=dict)
    _carried: dict[tuple[int, int], CarriedSpot] = field(default_factory=dict)
    _verdicts: dict[tuple[int, Stand, bool], Verdict] = field(default_factory=dict)

    def __post_init__(self) -> None:
        poses = self.track.poses
        self.poses = [
            StillContacts(
                self.hand, X, self.admissibility, poses[k + 1 :] if self.looks_ahead else (), self.facing
            )
            for k, X in enumerate(poses)
        ]

    @property
    def last(self) -> int:
        """The number of the last pose."""
        return len(self.poses) - 1

    def step(self, layer: int) -> ObjectMotion:
        """Return the motion from a pose to the next."""
        return self.track.steps[layer]

    def carry(self, layer: int, spot: int) -> CarriedSpot:
        """Return where in the next layer a contact is carried to."""
        key = (layer, spot)
        if key not in self._carried:
            placement = self.poses[layer].spots[spot]
            q, refusal = follow_object(self.hand, placement, self.step(layer).poses())
            there, states = None, list[FingerState]()
            if not refusal:
                label = self.poses[layer].labels[spot]
                there = self.poses[layer + 1].add(replace(placement, q=q[-1]), label)
                states = compute_finger_states(self.hand, placement.finger, q)
            self._carried[key] = CarriedSpot(there, tuple(states), refusal)
        return self._carried[key]

    def judge_carry(self, layer: int, stand: Stand, is_thorough: bool = True) -> Verdict:
        """Return the worst margins while a stand carries the object to the next pose, or why it cannot.

        Not ``is_thorough``: only half way and at the end are looked at.
        """
        key = layer, stand, is_thorough
        if key not in self._verdicts:
            motion = self.step(layer)
            poses = motion.poses()
            looks = np.arange(len(poses)) if is_thorough else np.array([len(poses) // 2, len(poses) - 1])
            ways = {f: self.carry(layer, s).states for f, s in enumerate(stand) if s is not None}
            states = {f: [way[k] for k in looks] for f, way in ways.items()}
            rows, refusal = judge_carry(self.hand, self.admissibility, states, motion, poses[looks])
            self._verdicts[key] = Verdict(worst(rows), refusal)
        return self._verdicts[key]

    def promise(self, layer: int, finger: int, partner: int) -> Array:
        """Return what pairs of ``partner`` with each of a finger's landings use of the cone, now and with the object at its end.

        inf where a pair does not hold now; 1 for the end where it does not hold then, or is far from where the finger stands.
        """
        key = layer, finger, partner
        if key not in self._promises:
            still, last = self.poses[layer], self.poses[-1]
            now = still.loads(finger, partner)
            now = np.where(now <= SLACK * self.hand.limits.cone_share, now, np.inf)
            turn = last.X_WO[:3, :3] @ still.X_WO[:3, :3].T
            pairs = still.pair_with(finger, partner).turned(turn)
            home = self.hand.p_WF_home[finger] - last.X_WO[:3, 3]
            wrench = compute_object_wrench(self.hand, None, last.X_WO[:3, :3])
            holds_now = np.isfinite(now)
            later = np.ones(len(now))
            later[holds_now] = np.minimum(pairs.take(holds_now).compute_loads(self.hand, wrench), 1.0)
            later = np.where(pairs.normals[:, 1] @ home > 0.3 * np.linalg.norm(home), later, 1.0)
            self._promises[key] = now + later
        return self._promises[key]
