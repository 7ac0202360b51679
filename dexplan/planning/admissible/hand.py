"""What the planner knows of the world: descriptions, workspaces, and two questions it may ask; no simulator."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.friction import SoftFinger
from dexplan.kinematics.chain import compute_joint_margin
from dexplan.kinematics.finger import FingerDescription
from dexplan.kinematics.workspace import Workspace
from dexplan.planning.admissible.limits import AdmissibleLimits
from dexplan.plans.forces import NormalForces
from dexplan.scene.description import Nearness, ObjectDescription
from dexplan.spatial import Array, read_only


class Probe(Protocol):
    """Kinematic queries that need the hand's full geometry; answered by ``scene.probe.HandProbe``."""

    def compute_clearance(
        self, q: Array, X_WO: Array, touching: tuple[int, ...], absent: tuple[int, ...] = ()
    ) -> tuple[float, str]:
        """Return the smallest distance [m] between bodies that should not touch, and their names; nothing ``absent`` counts."""
        ...

    def find_nearest(
        self, q: Array, X_WO: Array, touching: tuple[int, ...], absent: tuple[int, ...] = ()
    ) -> Nearness:
        """Return the same with whose bodies they are."""
        ...

    def find_overlaps(self) -> tuple[Nearness, ...]:
        """Return the bodies that touch or overlap whatever the hand does, the deepest first."""
        ...

    def compute_gravity_torque(self, q: Array) -> Array:
        """Return the joint torques (F, J) [N m] that hold the fingers' own weight."""
        ...


@dataclass(frozen=True, eq=False)
class HandModel:
    """A hand around an object, as the planner sees it.

    ``friction`` is the *believed* one; ``hover`` [m] the gap at which approaches start; ``acceleration`` the largest planned
    angular acceleration of the object [rad/s^2]; ``normal_force`` [N] what a loaded contact aims at.
    """

    fingers: tuple[FingerDescription, ...]
    object: ObjectDescription
    workspaces: tuple[Workspace, ...]
    friction: SoftFinger
    probe: Probe
    limits: AdmissibleLimits = field(default_factory=AdmissibleLimits)
    normal_force: float = NormalForces.target
    hover: float = 0.008
    acceleration: float = 2.8
    tip_polar_limit: float = float(np.radians(80.0))
    """Largest angle between a tip's pole and its contact on the tip [rad]."""
    tip_rotation_limit: float = float(np.radians(75.0))
    """How far a tip may roll round, seen from where its contact set out: the paper's gamma [rad]."""

    __repr__ = brief_repr

    @cached_property
    def p_WF_home(self) -> Array:
        """Tip centres (F, 3) [m] at home, in W."""
        return read_only(np.stack([f.pose_at(f.q_home)[:3, 3] for f in self.fingers]))

    @cached_property
    def q_home(self) -> Array:
        """Home postures (F, J) [rad]; who wants to write into them takes a copy."""
        return read_only(np.stack([f.q_home for f in self.fingers]))


def compute_travel_margin(hand: HandModel, finger: int) -> float:
    """Return how far [rad] a free finger's joints stay off their limits; what home has, where that is less."""
    who = hand.fingers[finger]
    return min(hand.limits.travel_margin, float(compute_joint_margin(who.chain, who.q_home)))
