"""A second opinion on a plan: walks through the actions as data and asks at every 2 degrees whether the hand can carry that.

Shares with the planner only what says whether a state is admissible.  Postures come from the plan's landing postures and are
carried along by inverse kinematics, with nothing known of orbits, stations or runs.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from dexplan.contact.friction import SoftFinger
from dexplan.grasp.closure import check_force_closure
from dexplan.grasp.grasp import Contact, Grasp
from dexplan.kinematics.arcs import build_travel, interpolate
from dexplan.kinematics.chain import compute_joint_margin, compute_tip_pose, solve_ik
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.actions import Action, Relocate
from dexplan.plans.contacts import Placement
from dexplan.plans.plan import Plan
from dexplan.spatial import Array, build_frame, rotate_about

SAMPLE = np.radians(2.0)
JUMP = 0.30
"""Largest joint step from one sample to the next [rad]."""


@dataclass(eq=False)
class Recheck:
    """Walks through ``plan`` with ``hand``; what is wrong ends up in ``faults``."""

    hand: HandModel
    plan: Plan
    faults: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._admissibility = Admissibility(self.hand)
        self._contacts: list[Placement | None] = list(self.plan.start_contacts)
        self._q = self.hand.q_home.copy()
        self._X_WO = self.plan.X_WO_start
        for contact in self._contacts:
            if contact is not None:
                self._check_placement("start", contact)
        self._check_order("start")
        for index, action in enumerate(self.plan.actions):
            name = f"{index} {action.name}"
            self._expect(name, np.allclose(action.X_WO_start, self._X_WO, atol=1e-12), "begins elsewhere")
            getattr(self, f"_check_{action.name}")(name, action)
            self._expect(name, self._is_at(action.contacts_end), "ends with other contacts")
            self._X_WO = action.X_WO_end
            self._check_order(name)

    # -- actions ---------------------------------------------------------------------------------------------------------

    def _check_hold(self, name: str, action: Action) -> None:
        self._expect(name, np.array_equal(action.X_WO_start, action.X_WO_end), "moves the object")
        self._check_state(name, action.X_WO_start, self._holding)

    def _check_move_object(self, name: str, action: Action) -> None:
        self._check_closure(name, self._holding)
        p_start, p_end = action.X_WO_start[:3, 3], action.X_WO_end[:3, 3]
        for share in np.linspace(0.0, 1.0, 2 + int(abs(action.motion.angle) / SAMPLE)):
            X_WO = action.X_WO_start.copy()
            X_WO[:3, :3] = rotate_about(action.motion.axis_W, share * action.motion.angle) @ X_WO[:3, :3]
            X_WO[:3, 3] = p_start + share * (p_end - p_start)
            for contact in self._contacts:
                if contact is not None:
                    self._carry(name, contact, X_WO)
            self._check_state(name, X_WO, self._holding, np.sign(action.motion.angle) * action.motion.axis_W)
        self._expect(name, np.allclose(X_WO, action.X_WO_end, atol=1e-9), "does not end where it says")

    def _check_place(self, name: str, action: Relocate) -> None:
        finger = action.finger
        self._expect(name, self._contacts[finger] is None, "places a finger that holds already")
        before = self._holding
        placed = action.contacts_end[finger]
        assert placed is not None
        hover = self._hover(name, placed)
        arc = build_travel(self.hand.fingers[finger], self._q[finger], hover, self._X_WO[:3, 3])
        path = self._check_ends(name, action.ways[0].postures, arc) if action.ways else arc
        self._check_path(name, finger, path, before)
        self._check_path(name, finger, self._lower(name, placed, hover), (*before, finger))
        self._contacts[finger] = placed
        self._check_placement(name, placed)
        self._check_state(name, self._X_WO, self._holding)
        self._expect(name, action.grasping == before, "names other fingers that hold meanwhile")

    def _check_lift(self, name: str, action: Relocate) -> None:
        finger = action.finger
        lifted = self._contacts[finger]
        assert lifted is not None
        rest = tuple(f for f in self._holding if f != finger)
        self._check_closure(name, rest)
        landed = replace(lifted, q=self._q[finger])
        hover = self._hover(name, landed)
        self._check_path(name, finger, self._lower(name, landed, hover), self._holding)
        self._contacts[finger] = None
        home = self.hand.fingers[finger].q_home
        arc = build_travel(self.hand.fingers[finger], hover, home, self._X_WO[:3, 3])
        path = self._check_ends(name, action.ways[0].postures, arc) if action.ways else arc
        self._check_path(name, finger, path, rest)
        self._q[finger] = home
        self._check_state(name, self._X_WO, rest)
        self._expect(name, action.grasping == rest, "names other fingers that hold meanwhile")

    # -- checks ----------------------------------------------------------------------------------------------------------

    @property
    def _holding(self) -> tuple[int, ...]:
        return tuple(i for i, c in enumerate(self._contacts) if c is not None)

    def _expect(self, name: str, holds: bool, fault: str) -> None:
        if not holds:
            self.faults.append(f"{name}: {fault}")

    def _is_at(self, contacts: tuple[Placement | None, ...]) -> bool:
        return all(
            (a is None) == (b is None) and (a is None or b is None or np.array_equal(a.X_OF, b.X_OF))
            for a, b in zip(self._contacts, contacts, strict=True)
        )

    def _check_placement(self, name: str, placed: Placement) -> None:
        """The tip touches where it says, its posture is the one that brings it there."""
        surface, radius = self.hand.object.surface, self.hand.fingers[placed.finger].tip_radius
        who = f"finger {placed.finger + 1}"
        touching = np.allclose(surface.radial(placed.normal_O), placed.point_O, atol=1e-9)
        self._expect(name, touching, f"{who}: the contact is off the surface")
        center = placed.point_O + radius * placed.normal_O
        self._expect(
            name, np.allclose(placed.X_OF[:3, 3], center, atol=1e-6), f"{who}: the tip does not touch"
        )
        X_WF = compute_tip_pose(self.hand.fingers[placed.finger].chain, placed.q)
        self._expect(
            name, np.allclose(X_WF, self._X_WO @ placed.X_OF, atol=1e-5), f"{who}: posture elsewhere"
        )
        self._q[placed.finger] = placed.q

    def _carry(self, name: str, contact: Placement, X_WO: Array) -> None:
        """Take a fixed contact along with the object, and the posture with it."""
        f = contact.finger
        q, reached = solve_ik(
            self.hand.fingers[f].chain, (X_WO @ contact.X_OF)[None], self._q[f][None], iterations=40
        )
        step = float(np.abs(q[0] - self._q[f]).max())
        self._expect(name, bool(reached[0]), f"finger {f + 1} cannot follow")
        self._expect(name, step < JUMP, f"finger {f + 1} jumps by {step:.2f} rad")
        self._q[f] = q[0]

    def _check_state(
        self, name: str, X_WO: Array, holding: tuple[int, ...], axis_W: Array | None = None
    ) -> None:
        margins = self._admissibility.compute_margins(self._q, X_WO, holding, axis_W=axis_W)
        self._expect(name, margins.is_admissible, margins.refusal)

    def _check_closure(self, name: str, holding: tuple[int, ...]) -> None:
        """The exact cones, by linear programming: no closed form of a sphere in it."""
        friction = self.hand.friction
        contacts = [c for i in holding if (c := self._contacts[i]) is not None]
        grasp = build_grasp(contacts, friction)
        self._expect(name, check_force_closure(grasp).is_closed, f"{holding} are not force closed")

    def _check_order(self, name: str) -> None:
        """The fingers stand around the vertical as their bases do [paper §4]; free ones are at home."""
        center = self._X_WO[:2, 3]
        stand = []
        for i, contact in enumerate(self._contacts):
            if contact is not None:
                stand.append((self._X_WO[:3, :3] @ contact.normal_O)[:2])
            else:
                stand.append(self.hand.fingers[i].pose_at(self.hand.fingers[i].q_home)[:2, 3] - center)
        bases = [f.chain.offsets[0][:2, 3] - center for f in self.hand.fingers]
        self._expect(name, _order(stand) == _order(bases), "the fingers have changed their order")

    def _hover(self, name: str, placed: Placement) -> Array:
        """Return the posture above a contact from which the finger comes down."""
        f = placed.finger
        X = placed.X_OF.copy()
        X[:3, 3] += self.hand.hover * placed.normal_O
        q, reached = solve_ik(
            self.hand.fingers[f].chain, (self._X_WO @ X)[None], placed.q[None], iterations=40
        )
        self._expect(name, bool(reached[0]), f"finger {f + 1} cannot hover over its contact")
        return q[0]

    def _lower(self, name: str, placed: Placement, hover: Array) -> Array:
        """Return postures (K, J) along the normal, from the hover down to the contact."""
        f, chain = placed.finger, self.hand.fingers[placed.finger].chain
        q, rows = hover, []
        for gap in np.linspace(self.hand.hover, 0.0, 5):
            X = placed.X_OF.copy()
            X[:3, 3] += gap * placed.normal_O
            solved, reached = solve_ik(chain, (self._X_WO @ X)[None], q[None])
            self._expect(name, bool(reached[0]), f"finger {f + 1} cannot come down along the normal")
            q = solved[0]
            rows.append(q)
        self._expect(
            name, np.allclose(q, placed.q, atol=1e-4), f"finger {f + 1} comes down on another branch"
        )
        return np.stack(rows)

    def _check_ends(self, name: str, way: Array, arc: Array) -> Array:
        """Return the plan's own way, which has to go where the arc would, as finely as the controller's spline sees it."""
        ends = np.allclose(way[[0, -1]], arc[[0, -1]], atol=1e-4)
        self._expect(name, ends, "a detour begins or ends elsewhere")
        return interpolate(way, np.linspace(0.0, 1.0, 161))

    def _check_path(self, name: str, finger: int, path: Array, touching: tuple[int, ...]) -> None:
        """Nothing in the way, everything within the limits."""
        chain = self.hand.fingers[finger].chain
        self._expect(name, float(compute_joint_margin(chain, path).min()) >= 0.0, "a path leaves the limits")
        q = self._q.copy()
        for posture in path:
            q[finger] = posture
            clearance, names = self.hand.probe.compute_clearance(q, self._X_WO, touching)
            if clearance < self.hand.limits.clearance:
                self.faults.append(f"{name}: {names} come within {1e3 * clearance:.2f} mm on the way")
                return


def build_grasp(contacts: list[Placement], friction: SoftFinger) -> Grasp:
    """Return the grasp of these contacts, all of them soft."""
    return Grasp(tuple(Contact(c.finger, c.point_O, build_frame(-c.normal_O), friction) for c in contacts))


def _order(points: list[Array]) -> tuple[int, ...]:
    """Return who follows whom counter-clockwise, beginning with the first."""
    ranked = [int(i) for i in np.argsort([np.arctan2(p[1], p[0]) for p in points])]
    first = ranked.index(0)
    return (*ranked[first:], *ranked[:first])
