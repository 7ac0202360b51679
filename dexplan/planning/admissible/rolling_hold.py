"""May fingers hold the object here, or carry it through here, on contacts that roll and pivot?

One station is judged at a time: clearance, what the contacts leave to torsional friction, and the forces, torques of the joints
included.  How many fingers that takes, and how far apart they have to be, is what comes out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.friction import SoftFinger
from dexplan.grasp.force.pivoting import PivotingContacts, PivotingForces, PivotingLimits, PivotingSolver
from dexplan.grasp.pairs import measure_chord_lean
from dexplan.grasp.wrench import DOWN, compute_wrench
from dexplan.kinematics.chain import compute_joint_margin
from dexplan.kinematics.may_carry import FOLLOWED, HeldContacts, Steering, compute_steering
from dexplan.planning.admissible.admissibility import Margins
from dexplan.planning.admissible.conditions import refuse_nearness
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.spatial import Array, lock_arrays

REST = np.zeros(6)


@dataclass(frozen=True, eq=False)
class TouchState:
    """One finger's contact at one pose of the object: posture ``q`` (J,), Jacobian ``J`` (6, J) of the tip's centre in W, and in
    the object's axes contact point ``p_O`` (3,) [m], **outward** normal ``n_O`` (3,) and tip pose ``X_OF`` (4, 4).
    """

    finger: int
    q: Array
    J: Array
    p_O: Array
    n_O: Array
    X_OF: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(frozen=True, eq=False)
class Station:
    """What was found at one station: its ``margins``, and unless refused the ``forces`` of the contacts and their ``pivots``
    (N,), turns about the outward normals per unit of the object's twist.
    """

    margins: Margins
    forces: PivotingForces | None = None
    pivots: Array | None = None

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(eq=False)
class RollingHold:
    """Answers for one hand; ``nominal`` is the friction that pivots are expected to bear, ``hand.friction`` the believed one."""

    hand: HandModel
    nominal: SoftFinger

    def __post_init__(self) -> None:
        believed = self.hand.friction.scaled(self.hand.limits.cone_share)
        self._solver = PivotingSolver(believed, self.nominal, self.hand.object.body.bound)

    def judge(self, states: Sequence[TouchState], X_WO: Array, twist: Array = REST) -> Station:
        """Return what fingers in ``states`` have to spare with the object at ``X_WO`` (4, 4), free fingers at home.

        ``twist`` (6,): velocity of the object's origin in units of 60 mm, and angular velocity, W; of any size; 0 is rest.
        """
        hand, limits = self.hand, self.hand.limits
        q = hand.q_home.copy()
        for state in states:
            q[state.finger] = state.q
        holding = tuple(state.finger for state in states)
        chains = [hand.fingers[f].chain for f in holding]
        joint = min(float(compute_joint_margin(c, s.q[None])[0]) for c, s in zip(chains, states, strict=True))
        nearest = hand.probe.find_nearest(q, X_WO, holding)

        def refuse(refusal: Refusal) -> Station:
            return Station(Margins(joint, 0.0, -np.inf, np.inf, nearest.distance, refusal))

        if nearest.distance < limits.clearance:
            return refuse(refuse_nearness(nearest, limits.clearance))
        names = tuple(hand.fingers[f].name for f in holding)
        steering = self.steer(states, X_WO, twist)
        if not steering.may_carry:
            return refuse(Refusal(RefusalKind.LEFT_TO_TORSION, names))
        pivots = np.where(np.abs(steering.pivots) > FOLLOWED, steering.pivots, 0.0)
        found = self._solve(states, X_WO, np.sign(pivots), q)
        if found is None:
            return refuse(Refusal(RefusalKind.LOAD))
        reach = np.stack([hand.fingers[f].torque_limit for f in holding])
        share = float((np.abs(found.torque) / reach).max())
        used = float(found.used.max()) * limits.cone_share
        margins = Margins(joint, steering.strength, 1.0 - used, share, nearest.distance)
        return Station(margins, found, pivots)

    def steer(self, states: Sequence[TouchState], X_WO: Array, twist: Array) -> Steering:
        """Return what contacts decide of the object's motion."""
        R, p = X_WO[:3, :3], X_WO[:3, 3]
        contacts = HeldContacts(
            np.stack([p + R @ s.p_O for s in states]),
            np.stack([R @ s.n_O for s in states]),
            tuple(s.J for s in states),
            np.array([self.hand.fingers[s.finger].tip_radius for s in states]),
        )
        return compute_steering(contacts, p, twist)

    def _solve(
        self, states: Sequence[TouchState], X_WO: Array, pivots: Array, q: Array
    ) -> PivotingForces | None:
        hand, limits, R = self.hand, self.hand.limits, X_WO[:3, :3]
        holding = [s.finger for s in states]
        arms, normals = np.stack([R @ s.p_O for s in states]), np.stack([R @ s.n_O for s in states])
        radii = np.array([hand.fingers[f].tip_radius for f in holding])
        contacts = PivotingContacts(
            arms, normals, -radii[:, None] * normals, np.stack([s.J for s in states]), pivots
        )
        reach = limits.torque_share * np.stack([hand.fingers[f].torque_limit for f in holding])
        bias, one = hand.probe.compute_gravity_torque(q)[holding], np.ones(len(holding))
        bounds = PivotingLimits(
            limits.normal_floor * one,
            limits.normal_ceiling * one,
            hand.normal_force * one,
            -reach,
            reach,
            bias,
        )
        return self._solver.solve(contacts, compute_wrench(hand.object.mass_properties, R), bounds)

    def estimate_pairs(self, X_WO: Array, state: TouchState, p_O: Array, n_O: Array) -> Array:
        """Return about which share of the believed cone a contact and each of N others (N, 3) take to hold the object; at least
        this share, and inf where they hold for sure not.

        The squeeze has to lie in both cones, and what gravity turns about the chord is left to torsion.
        """
        hand, friction = self.hand, self.hand.friction
        points = np.stack([np.broadcast_to(state.p_O, p_O.shape), p_O], axis=1)
        normals = np.stack([np.broadcast_to(state.n_O, n_O.shape), n_O], axis=1)
        lean = np.tan(np.minimum(measure_chord_lean(points, normals), 1.5)) / friction.sliding
        chord = points[:, 1] - points[:, 0]
        chord /= np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-12)
        own = hand.object.mass_properties
        weight_O = own.mass * (X_WO[:3, :3].T @ DOWN)
        moment = np.abs(np.sum(np.cross(own.com - points[:, 0], weight_O) * chord, axis=1))
        torsion = moment / (2.0 * friction.torsional * hand.limits.normal_ceiling)
        is_out = np.maximum(lean, torsion) > hand.limits.cone_share
        return np.where(is_out, np.inf, np.hypot(lean, torsion))
