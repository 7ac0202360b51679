"""Can fingers really be at these contacts, and come there?  Room, forces and ways, one state at a time, for brute force."""

from __future__ import annotations

import numpy as np

from dexplan.grasp.wrench import compute_wrench
from dexplan.kinematics.arcs import build_travel
from dexplan.kinematics.chain import compute_joint_margin, solve_ik, wrap_near
from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array
from dexplan.witness.grasp_grid import Grid, PairTables, get_pair_limits, solve_postures
from dexplan.witness.several_contacts import measure_grasp_spare
from dexplan.witness.two_contacts import PairTorques, build_frames_into, map_to_joints, measure_spare

LIFTS = (0.025, 0.05)
"""Where the way between home and above a contact is blocked, a free finger goes over places so far off it [m]."""
SAMPLES = 13
"""Postures looked at on a straight piece of such a way."""

Contact = tuple[int, int]
"""A finger and the number of a contact on the grid."""


class PairJudge:
    """Judges contacts of ``grid`` with the object at poses ``X_WO`` (K, 4, 4); answers are kept."""

    def __init__(self, hand: HandModel, X_WO: Array, grid: Grid) -> None:
        self.hand, self.X_WO, self.grid = hand, X_WO, grid
        self.postures = solve_postures(hand, X_WO, grid)
        self.tables = PairTables(hand, X_WO, grid, self.postures)
        self.looked_at = 0
        self._held: dict[tuple[int, tuple[Contact, ...]], bool] = {}
        self._ways: dict[tuple[int, Contact, tuple[Contact, ...]], bool] = {}

    def holds(self, k: int, contacts: tuple[Contact, ...]) -> bool:
        """Return whether fingers can be at these contacts at pose ``k``, all others at home.

        They have to hold the object, with joint torques looked at, and every one of them pressed with the least normal force at
        least: of three, that is more than two of their pairs holding.
        """
        key = (k, tuple(sorted(contacts)))
        if key not in self._held:
            self.looked_at += 1
            self._held[key] = (
                self.tables.is_in_order(k, contacts)
                and self._is_clear(k, contacts)
                and self.measure_spare(k, contacts) >= 0.0
            )
        return self._held[key]

    def measure_spare(self, k: int, contacts: tuple[Contact, ...]) -> float:
        """Return the force [N] that two or three contacts have to spare, torques of the joints included."""
        hand, X = self.hand, self.X_WO[k]
        sites, site, q = self.grid.sites, self.grid.site, self.place(k, contacts)
        rows = [site[c] for _, c in contacts]
        arms = sites.points[rows] @ X[:3, :3].T
        frames = build_frames_into(sites.normals[rows] @ X[:3, :3].T)
        maps = [
            map_to_joints(hand.fingers[f], q[f], hand.fingers[f].pose_at(q[f]), X[:3, 3] + arm, frame)
            for (f, _), arm, frame in zip(contacts, arms, frames, strict=True)
        ]
        fingers = [f for f, _ in contacts]
        bias = hand.probe.compute_gravity_torque(q)[fingers]
        most = hand.limits.torque_share * np.stack([hand.fingers[f].torque_limit for f in fingers])
        torques = PairTorques(np.stack(maps)[None], bias[None], most)
        wrench = compute_wrench(hand.object.mass_properties, X[:3, :3])
        limits = get_pair_limits(hand)
        if len(contacts) > 2:
            return measure_grasp_spare(arms, frames, wrench, limits, torques)
        return float(measure_spare(arms[None], frames[None], wrench, limits, torques)[0])

    def place(self, k: int, contacts: tuple[Contact, ...]) -> Array:
        """Return the postures (F, J) with these contacts, all others at home; the tips' own joints amid their ranges."""
        q = self.hand.q_home.copy()
        for f, c in contacts:
            q[f] = self.postures.q[k, f, c]
            chain = self.hand.fingers[f].chain
            if chain.has_tip_roll:
                q[f, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
        return q

    def _is_clear(self, k: int, contacts: tuple[Contact, ...]) -> bool:
        fingers = tuple(f for f, _ in contacts)
        nearest = self.hand.probe.find_nearest(self.place(k, contacts), self.X_WO[k], fingers)
        return bool(nearest.distance >= self.hand.limits.clearance)

    def comes(self, k: int, mover: Contact, holding: tuple[Contact, ...]) -> bool:
        """Return whether a free finger gets between home and its contact while the others hold.

        From home it goes to where its tip hovers over the contact, around the object or straight; or first to a place farther
        off the contact, and from there straight to it.
        """
        key = (k, mover, tuple(sorted(holding)))
        if key not in self._ways:
            self.looked_at += 1
            f, c = mover
            finger, q, X_WO = self.hand.fingers[f], self.place(k, holding), self.X_WO[k]
            at = self.place(k, (mover,))[f]
            normal = X_WO[:3, :3] @ self.grid.sites.normals[self.grid.site[c]]
            touching = tuple(g for g, _ in holding)

            def is_open(way: Array) -> bool:
                if compute_joint_margin(finger.chain, way).min() < 0.0:
                    return False
                for posture in way:
                    q[f] = posture
                    nearest = self.hand.probe.find_nearest(q, X_WO, touching)
                    if nearest.distance < self.hand.limits.clearance:
                        return False
                return True

            def is_open_from_home(end: Array) -> bool:
                around = build_travel(finger, finger.q_home, end, X_WO[:3, 3])
                return is_open(around) or is_open(_go_straight(finger.q_home, end))

            hover = self._lift(f, at, normal, self.hand.hover)
            self._ways[key] = hover is not None and (
                is_open_from_home(hover)
                or any(
                    is_open(_go_straight(via, hover)) and is_open_from_home(via)
                    for gap in LIFTS
                    if (via := self._lift(f, at, normal, gap)) is not None
                )
            )
        return self._ways[key]

    def _lift(self, finger: int, q: Array, normal: Array, gap: float) -> Array | None:
        """Return the posture (J,) with the tip ``gap`` [m] off along ``normal`` (3,) in W; None out of reach."""
        chain = self.hand.fingers[finger].chain
        X = self.hand.fingers[finger].pose_at(q)[None].copy()
        X[:, :3, 3] += gap * normal
        solved, reached = solve_ik(chain, X, q[None])
        return wrap_near(solved[0], q) if reached[0] else None


def _go_straight(start: Array, end: Array) -> Array:
    return np.asarray(start + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (end - start))
