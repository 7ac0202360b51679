"""A simple controller for hands whose contacts roll: velocities of the contacts, forces of the contacts, and joint impedance.

Once per tick: the joint rates of fingers that hold follow from "the tip's surface goes along with the object's at the contact",
``J_c qdot = v + w x r``; the contact is where the body is nearest to the tip's centre.  Forces come from the program that
planning asks (:mod:`dexplan.grasp.force.pivoting`): what holds the object, torque limits inside, torsion of planned pivots
saturated.  The servos are told the sum: gravity of the links, forces, and a stiffness about the postures that rates add up to.

Feedback of the object's pose goes into the rates and into the wrench, while the contact points alone decide the object's motion;
two of them leave a turn to torsion, and correct nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dexplan.contact.friction import SoftFinger
from dexplan.control.foreign import ForeignCommand
from dexplan.control.hand import MeasuredHand, build_hand_body
from dexplan.control.observation import Observation
from dexplan.control.reference import ObjectState
from dexplan.control.rolling_phases import Doing, RollingTiming, Stretch, build_stretches
from dexplan.grasp.force.pivoting import PivotingContacts, PivotingForces, PivotingLimits, PivotingSolver
from dexplan.grasp.wrench import compute_wrench
from dexplan.kinematics.chain import Chain, compute_tip_jacobian, compute_tip_pose
from dexplan.plans.plan import Plan
from dexplan.scene.scene import Scene
from dexplan.spatial import Array, hat, rotation_vector

LIGHT = 0.05
"""Normal force of a contact that has just touched, or is about to leave [N]."""
DECIDED = 0.05
"""Smallest singular value of the contact points' rows from which they decide the object's motion, lengths in 60 mm [-]."""


@dataclass(frozen=True)
class RollingGains:
    """Gains of the loop, per finger and joint alike.

    ``stiffness`` [N m/rad] and ``damping`` [N m s/rad] about the postures commanded; ``follow`` [1/s]: how fast these give way
    to the measured ones; ``rate`` [1/s]: how fast the object's error is taken out by motion.  By forces: ``push`` [N/m],
    ``twist`` [N m/rad], what grows by ``push_grow`` [N/m/s] and ``twist_grow`` [N m/rad/s].  ``spin`` [rad/s]: a pivot much
    faster than this has overcome torsion.
    """

    stiffness: float = 5.0
    damping: float = 0.1
    follow: float = 1.0
    rate: float = 3.0
    push: float = 30.0
    twist: float = 0.05
    push_grow: float = 60.0
    twist_grow: float = 0.1
    most_push: float = 0.4
    most_twist: float = 0.012
    spin: float = 0.02
    torque_share: float = 0.97


@dataclass(frozen=True)
class RollingBelief:
    """What the controller believes of friction: what forces keep inside, and what pivots are expected to bear."""

    believed: SoftFinger
    nominal: SoftFinger


@dataclass(eq=False)
class RollingController:
    """Carries out a plan on a scene; :meth:`step` is asked once per ``tick`` [s].

    ``unbalanced`` counts the ticks for which no forces were found.
    """

    scene: Scene
    plan: Plan
    belief: RollingBelief
    tick: float = 0.004
    timing: RollingTiming = field(default_factory=RollingTiming)
    gains: RollingGains = field(default_factory=RollingGains)

    def __post_init__(self) -> None:
        scene, shape = self.scene, (self.scene.n_fingers, self.scene.fingers[0].chain.n_joints)
        self.stretches = build_stretches(self.plan, self.timing)
        self._hand = MeasuredHand(build_hand_body(scene))
        self._solver = PivotingSolver(self.belief.believed, self.belief.nominal, scene.object.body.bound)
        self._reach = np.stack([f.torque_limit for f in scene.fingers])
        self._kp = np.stack([f.servo_gain for f in scene.fingers])
        self._kv = np.stack([f.servo_damping for f in scene.fingers])
        self._goal = np.zeros(shape)
        self._pressing = np.zeros(shape)
        self._grown = np.zeros(6)
        self._number, self._since = 0, 0.0
        self._last: dict[int, Array] = {}
        self._is_begun = False
        self.unbalanced = 0

    @property
    def duration(self) -> float:
        """Planned duration [s]."""
        return sum(stretch.duration for stretch in self.stretches)

    def step(self, observation: Observation) -> ForeignCommand:
        """Return the servos' targets for the tick that starts now."""
        if not self._is_begun:
            self._is_begun, self._goal = True, observation.q.copy()
        failure = self._advance(observation)
        stretch = self.stretches[self._number]
        t = observation.time - self._since
        wanted = stretch.sample_object(t)
        self._hand.measure(observation.q, observation.qdot)
        torque = self._compute_torque(observation, stretch, wanted, t)
        limited = np.clip(torque, -self._reach, self._reach)
        # The servo gives kp (target - q) - kv qdot.
        ctrl = observation.q + (limited + self._kv * observation.qdot) / self._kp
        is_done = self._number == len(self.stretches) - 1 and t >= stretch.duration
        return ForeignCommand(
            ctrl.ravel(), wanted.X_WO, stretch.action_index, stretch.phase_index, is_done, failure
        )

    def _advance(self, observation: Observation) -> str | None:
        """Go on to the stretch that it is time for; return what failed."""
        while self._number < len(self.stretches) - 1:
            stretch, t = self.stretches[self._number], observation.time - self._since
            if stretch.doing is Doing.APPROACH:
                assert stretch.finger is not None
                if not observation.touching[stretch.finger]:
                    late = t > stretch.duration + self.timing.timeout
                    name = self.scene.fingers[stretch.finger].name
                    return f"{name} found nothing to touch" if late else None
            elif t < stretch.duration - 1e-9:
                return None
            self._number, self._since = self._number + 1, observation.time
            if stretch.finger is not None:
                # A finger that touches, or leaves, starts from where it is.
                self._goal[stretch.finger] = observation.q[stretch.finger]
        return None

    def _compute_torque(self, seen: Observation, stretch: Stretch, wanted: ObjectState, t: float) -> Array:
        """Return the joint torques (F, J) [N m] wanted now, and move the postures commanded on."""
        gains, hand, dt = self.gains, self._hand, self.tick
        holding, rates = stretch.holding, np.zeros_like(self._goal)
        is_ramping = stretch.doing in {Doing.LOAD, Doing.UNLOAD}
        error = wanted.X_WO[:3, 3] - seen.X_WO[:3, 3]
        turn = rotation_vector(wanted.X_WO[:3, :3] @ seen.X_WO[:3, :3].T)
        off = np.concatenate([error, turn])
        jacobians = [
            np.concatenate([J[0], J[1]]) for J in hand.compute_jacobians(range(self.scene.n_fingers))
        ]
        contacts = self._find_contacts(seen, holding, jacobians, wanted.twist)
        is_steered = not is_ramping and _decides_motion(contacts)
        twist = wanted.twist + (gains.rate * off if is_steered else 0.0)
        for k, f in enumerate(holding):
            rates[f] = np.linalg.pinv(_contact_rows(contacts, k), rcond=1e-4) @ (
                twist[:3] + np.cross(twist[3:], contacts.arms[k])
            )
            self._goal[f] += dt * (rates[f] + gains.follow * (seen.q[f] - self._goal[f]))
        torque = hand.bias.copy()
        if holding:
            torque += self._press(seen, stretch, contacts, wanted, off if is_steered else None, t)
        if stretch.finger is not None and stretch.finger not in holding:
            rates[stretch.finger] = self._move_free(stretch, seen, t)
        return torque + gains.stiffness * (self._goal - seen.q) + gains.damping * (rates - seen.qdot)

    def _find_contacts(
        self, seen: Observation, holding: tuple[int, ...], jacobians: list[Array], twist: Array
    ) -> PivotingContacts:
        """Return where fingers touch, and whether they pivot if the object moves as planned."""
        R, p = seen.X_WO[:3, :3], seen.X_WO[:3, 3]
        centers = np.array([self._hand.tips[f].p for f in holding]).reshape(-1, 3)
        found = self.scene.object.body.project((centers - p) @ R)
        normals, arms = found.normal @ R.T, found.point @ R.T
        radii = np.array([self.scene.fingers[f].tip_radius for f in holding])
        J = np.array([jacobians[f] for f in holding])
        still = PivotingContacts(arms, normals, -radii[:, None] * normals, J, np.zeros(len(holding)))
        spins = np.zeros(len(holding))
        if np.any(twist):
            for k, n in enumerate(normals):
                qdot = np.linalg.pinv(_contact_rows(still, k), rcond=1e-4) @ (
                    twist[:3] + np.cross(twist[3:], arms[k])
                )
                spins[k] = n @ (J[k, 3:] @ qdot - twist[3:])
        pivots = np.tanh(spins / self.gains.spin)
        return PivotingContacts(arms, normals, still.offsets, J, pivots)

    def _press(
        self,
        seen: Observation,
        stretch: Stretch,
        contacts: PivotingContacts,
        wanted: ObjectState,
        off: Array | None,
        t: float,
    ) -> Array:
        """Return the joint torques (F, J) of the contact forces."""
        gains, plan, holding = self.gains, self.plan, list(stretch.holding)
        a, alpha = wanted.acceleration[:3], wanted.acceleration[3:]
        wrench = compute_wrench(
            self.scene.object.mass_properties, seen.X_WO[:3, :3], acceleration=a, angular_acceleration=alpha
        )
        if off is not None:
            grow = np.repeat([gains.push_grow, gains.twist_grow], 3)
            most = np.repeat([gains.most_push, gains.most_twist], 3)
            self._grown = np.clip(self._grown + self.tick * grow * off, -most, most)
            wrench = wrench + np.repeat([gains.push, gains.twist], 3) * off + self._grown
        one = np.ones(len(holding))
        floor, ceiling = plan.normal_floor * one, plan.normal_ceiling * one
        if stretch.doing in {Doing.LOAD, Doing.UNLOAD} and stretch.finger is not None:
            k, share = holding.index(stretch.finger), min(t / stretch.duration, 1.0)
            if stretch.doing is Doing.LOAD:
                floor[k] = LIGHT + (plan.normal_floor - LIGHT) * share
            else:
                before = self._last.get(stretch.finger, np.zeros(4))[2]
                floor[k] = LIGHT + max(before - LIGHT, 0.0) * (1.0 - share)
            ceiling[k] = floor[k] + 0.01
        reach = gains.torque_share * self._reach[holding]
        limits = PivotingLimits(
            floor,
            ceiling,
            np.minimum(plan.normal_force, ceiling),
            -reach,
            reach,
            self._hand.bias[holding],
        )
        found = self._solver.solve(contacts, wrench, limits)
        self.unbalanced += found is None
        torque = np.zeros_like(self._goal)
        for k, f in enumerate(holding):
            if found is not None:
                torque[f] = _read_torque(found, contacts, k)
                if stretch.doing is not Doing.UNLOAD:
                    self._last[f] = found.forces[k]
        # Where no forces are found the last ones have to do.
        self._pressing = torque if found is not None else self._pressing
        return self._pressing

    def _move_free(self, stretch: Stretch, seen: Observation, t: float) -> Array:
        """Move the posture commanded of the free finger on; return its rates (J,) [rad/s]."""
        finger = stretch.finger
        assert finger is not None
        before = self._goal[finger].copy()
        if stretch.doing is Doing.TRAVEL:
            self._goal[finger] = stretch.sample_way(t)
        else:
            chain = self.scene.fingers[finger].chain
            gap = stretch.sample_gap(t, self.plan.touchdown.hover, self.timing)
            self._goal[finger] = _stay_on_normal(chain, stretch, seen.X_WO, gap, before)
        return np.clip((self._goal[finger] - before) / self.tick, -4.0, 4.0)


def _stay_on_normal(chain: Chain, stretch: Stretch, X_WO: Array, gap: float, q: Array) -> Array:
    """Return the posture (J,) near ``q`` with the tip ``gap`` [m] off the object, on the normal of its contact."""
    placement = stretch.placement
    assert placement is not None
    center = X_WO[:3, :3] @ (placement.X_OF[:3, 3] + gap * placement.normal_O) + X_WO[:3, 3]
    for _ in range(3):
        missing = center - compute_tip_pose(chain, q)[:3, 3]
        step = np.linalg.pinv(compute_tip_jacobian(chain, q)[:3], rcond=1e-3) @ missing
        q = q + np.clip(step, -0.05, 0.05)
    return q


def _decides_motion(contacts: PivotingContacts) -> bool:
    """Return whether contact points that go along with the fingers leave the object no motion of its own."""
    rows = [np.hstack([np.eye(3), -hat(arm) / 0.06]) for arm in contacts.arms]
    sizes = np.linalg.svd(np.vstack(rows), compute_uv=False) if rows else np.zeros(1)
    return len(sizes) == 6 and bool(sizes[-1] >= DECIDED)


def _contact_rows(contacts: PivotingContacts, k: int) -> Array:
    """Return J_c (3, J): the velocity of the tip's surface at contact ``k`` per joint rate."""
    J = contacts.jacobians[k]
    return J[:3] - hat(contacts.offsets[k]) @ J[3:]


def _read_torque(found: PivotingForces, contacts: PivotingContacts, k: int) -> Array:
    """Return the joint torques (J,) [N m] with which a finger exerts its force on the object."""
    J = contacts.jacobians[k]
    return _contact_rows(contacts, k).T @ found.force_W[k] + J[3:].T @ found.moment_W[k]
