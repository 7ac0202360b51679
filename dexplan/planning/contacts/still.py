"""Contacts around an object that stands still: where fingers can land, which grasps hold, whether ways between them are clear."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from dexplan.kinematics.arcs import build_travel, compute_hover
from dexplan.kinematics.chain import compute_joint_margin, compute_tip_pose
from dexplan.kinematics.spherical_wrist import estimate_dexterity, solve_tip_pose
from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.admissible.admissibility import (
    Admissibility,
    FingerState,
    Margins,
    compute_finger_states,
)
from dexplan.planning.admissible.aligned import build_aligned
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.loads import compute_object_wrench, compute_pair_loads
from dexplan.planning.admissible.order import keeps_order
from dexplan.planning.admissible.separation import compute_opposition, compute_pair_angle_max
from dexplan.planning.ways.detour import Surroundings
from dexplan.planning.ways.travel import Way, find_way
from dexplan.plans.contacts import Placement
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.spatial import Array, invert_pose

Stand = tuple[int | None, ...]
"""Per finger the number of its spot, None where it is free (at home)."""
Labels = tuple[int | None, ...]
"""Per finger what its contact is to the goal, as :meth:`StillContacts.label` says."""

DIRECTIONS = 240
"""Directions around the object at which intermediate landings are tried."""
DETOURS = 4
"""So many detours are looked for in vain around one pose of the object."""


def change_stand(stand: Stand, finger: int, spot: int | None) -> Stand:
    """Return the stand with one finger elsewhere."""
    return (*stand[:finger], spot, *stand[finger + 1 :])


def build_landings(hand: HandModel, X_WO: Array, finger: int, normals_O: Array) -> list[Placement | None]:
    """Return how a finger touches along outward normals (N, 3) in object axes, its pole along them; None where it cannot.

    A tip that can roll about its pole lands with that joint in the middle of its range.
    """
    description, limits = hand.fingers[finger], hand.limits
    chain, workspace = description.chain, hand.workspaces[finger]
    if not len(workspace.postures) or not len(normals_O):
        return [None] * len(normals_O)
    normals_W = normals_O @ X_WO[:3, :3].T
    q, reached = solve_tip_pose(workspace, build_aligned(hand, finger, X_WO[:3, 3], normals_W))
    if chain.has_tip_roll:
        q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
    usable = reached & (compute_joint_margin(chain, q) >= limits.joint_margin)
    usable[usable] = estimate_dexterity(chain, q[usable]) >= limits.dexterity
    X_OF = invert_pose(X_WO) @ compute_tip_pose(chain, q)
    surface = hand.object.surface
    return [
        Placement(finger, surface.radial(n), n, X, posture) if good else None
        for n, X, posture, good in zip(normals_O, X_OF, q, usable, strict=True)
    ]


def land_again(hand: HandModel, X_WO: Array, placement: Placement) -> Placement | None:
    """Return the same contact, tip pose in the object and all, with the object at ``X_WO`` (4, 4); None out of reach."""
    description, limits = hand.fingers[placement.finger], hand.limits
    X_WF = (X_WO @ placement.X_OF)[None]
    q, reached = solve_tip_pose(hand.workspaces[placement.finger], X_WF, counts_spin=True)
    good = reached[0] and compute_joint_margin(description.chain, q[0]) >= limits.joint_margin
    if not good or float(estimate_dexterity(description.chain, q)[0]) < limits.dexterity:
        return None
    return replace(placement, q=q[0])


@dataclass(eq=False)
class StillContacts:
    """All contacts considered while the object stands at ``X_WO`` (4, 4); answers are kept.

    ``labels`` says of every spot whether it is a goal contact (0), one from which a goal contact is rolled to (1, 2, ..), or
    neither (None).
    """

    hand: HandModel
    X_WO: Array
    admissibility: Admissibility
    spots: list[Placement] = field(default_factory=list)
    labels: list[int | None] = field(default_factory=list)
    _states: list[FingerState] = field(default_factory=list)
    _normals: list[Array] = field(default_factory=list)
    _margins: dict[Stand, Margins] = field(default_factory=dict)
    _landings: dict[int, list[int]] = field(default_factory=dict)
    _loads: dict[tuple[int, int], Array] = field(default_factory=dict)
    _arcs: dict[int, Array] = field(default_factory=dict)
    _ways: dict[tuple[Stand, int, bool], Way] = field(default_factory=dict)
    _detours: int = 0

    def __post_init__(self) -> None:
        limits = self.hand.limits
        beta = compute_pair_angle_max(self.hand.friction.scaled(limits.cone_share)) - limits.closure_margin
        self.opposite = -compute_opposition(beta)
        """Two contacts hold where the cosine between their normals is less than this."""

    def add(self, placement: Placement, label: int | None = None) -> int:
        """Note a contact; return its number."""
        return self.add_all([placement], label)[0]

    def add_all(self, placements: list[Placement], label: int | None = None) -> list[int]:
        """Note contacts of one finger; return their numbers."""
        if not placements:
            return []
        q = np.stack([p.q for p in placements])
        first = len(self.spots)
        self.spots += placements
        self.labels += [label] * len(placements)
        self._states += compute_finger_states(self.hand, placements[0].finger, q)
        self._normals += [self.X_WO[:3, :3] @ p.normal_O for p in placements]
        return list(range(first, len(self.spots)))

    def landings(self, finger: int) -> list[int]:
        """Return places all over the object where a finger can land, as far as it alone is concerned."""
        if finger not in self._landings:
            normals = spread_directions(DIRECTIONS)
            normals = normals[self.hand.object.allows(normals)]
            home = self.hand.p_WF_home[finger] - self.X_WO[:3, 3]
            normals = normals[normals @ self.X_WO[:3, :3].T @ home > 0.0]
            found = build_landings(self.hand, self.X_WO, finger, normals)
            self._landings[finger] = self.add_all([p for p in found if p is not None])
        return self._landings[finger]

    def loads(self, finger: int, partner: int) -> Array:
        """Return which share of the believed cone it takes to hold with ``partner`` and each of the landings of a finger."""
        key = finger, partner
        if key not in self._loads:
            normals = np.array([self._normals[s] for s in self.landings(finger)]).reshape(-1, 3)
            other = np.broadcast_to(self._normals[partner], normals.shape)
            wrench = compute_object_wrench(self.hand, None)
            used = (
                compute_pair_loads(self.hand, other, normals, wrench).utilisation
                if len(normals)
                else np.zeros(0)
            )
            self._loads[key] = np.where(normals @ self._normals[partner] < self.opposite, used, np.inf)
        return self._loads[key]

    def normal(self, spot: int) -> Array:
        """Return the outward normal (3,) of a spot in W."""
        return self._normals[spot]

    def label(self, stand: Stand) -> Labels:
        """Return the labels of a stand; -1 for a contact without one, None for a free finger."""
        return tuple(None if s is None else -1 if (found := self.labels[s]) is None else found for s in stand)

    def placements(self, stand: Stand) -> tuple[Placement | None, ...]:
        """Return the contacts of a stand."""
        return tuple(None if s is None else self.spots[s] for s in stand)

    def postures(self, stand: Stand) -> Array:
        """Return the postures (F, J) of a stand, free fingers at home."""
        q = self.hand.q_home.copy()
        for finger, spot in enumerate(stand):
            if spot is not None:
                q[finger] = self.spots[spot].q
        return q

    def forms_pair(self, a: int, b: int) -> bool:
        """Return whether two spots are force closed with the believed friction and a margin."""
        return bool(self._normals[a] @ self._normals[b] < self.opposite)

    def has_pair(self, stand: Stand) -> bool:
        """Return whether two of the contacts of a stand are force closed."""
        held = [s for s in stand if s is not None]
        return any(self.forms_pair(a, b) for i, a in enumerate(held) for b in held[i + 1 :])

    def judge(self, stand: Stand) -> Margins:
        """Return the margins of holding the object with a stand."""
        if stand not in self._margins:
            states = {f: self._states[s] for f, s in enumerate(stand) if s is not None}
            row = self.admissibility.compute_margins_of(
                states, self.postures(stand), self.X_WO, explain=False
            )
            if row.is_admissible and not self._keeps_order(stand):
                row = replace(row, refusal=Refusal(RefusalKind.ORDER))
            self._margins[stand] = row
        return self._margins[stand]

    def _keeps_order(self, stand: Stand) -> bool:
        normals = {f: p - self.X_WO[:3, 3] for f, p in enumerate(self.hand.p_WF_home)}
        normals.update({f: self._normals[s] for f, s in enumerate(stand) if s is not None})
        return keeps_order(self.hand, normals)

    def find_change(self, before: Stand, after: Stand) -> Way:
        """Return the way of the one finger by which two stands differ; it touches in one of them only."""
        finger = next(f for f, (a, b) in enumerate(zip(before, after, strict=True)) if a != b)
        spot = before[finger] if after[finger] is None else after[finger]
        assert spot is not None
        return self.find_way(change_stand(before, finger, None), spot)

    def find_way(self, stand: Stand, spot: int, looks_around: bool = True) -> Way:
        """Return how a free finger of ``stand`` goes between home and ``spot``.

        If it ``looks_around``, it goes around what is in the way of the arc.

        The last bit, from the hover down along the normal, is judged at its end, where all touch.
        """
        key = (stand, spot, looks_around)
        if key not in self._ways:
            placement = self.spots[spot]
            finger = self.hand.fingers[placement.finger]
            if spot not in self._arcs:
                hover = compute_hover(
                    finger, self.X_WO, placement.X_OF, placement.normal_O, placement.q, self.hand.hover
                )
                self._arcs[spot] = build_travel(finger, finger.q_home, hover, self.X_WO[:3, 3])
            arc = self._arcs[spot]
            touching = tuple(f for f, s in enumerate(stand) if s is not None)
            around = Surroundings(self.hand, self.postures(stand), self.X_WO, placement.finger, touching)
            way = find_way(around, arc, looks_around and self._detours < DETOURS)
            self._detours += looks_around and way.clearance < self.hand.limits.clearance
            self._ways[key] = way
        return self._ways[key]
