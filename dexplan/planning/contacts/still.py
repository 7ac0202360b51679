"""Contacts around an object that stands still: where fingers can land, which grasps hold, whether ways between them are clear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from dexplan.grasp.pairs import measure_chord_lean
from dexplan.kinematics.arcs import build_travel, compute_hover
from dexplan.planning.admissible.admissibility import (
    Admissibility,
    FingerState,
    Margins,
    compute_finger_states,
)
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.loads import compute_object_wrench
from dexplan.planning.admissible.order import keep_order, keeps_order
from dexplan.planning.admissible.separation import compute_pair_angle_max
from dexplan.planning.contacts.landings import FACING, TILTS, build_landings, find_facing, list_sites
from dexplan.planning.contacts.spins import center_spins
from dexplan.planning.contacts.spot_pairs import SpotPairs, pair_all
from dexplan.planning.ways.detour import Surroundings
from dexplan.planning.ways.travel import Way, find_way
from dexplan.plans.contacts import Placement
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.spatial import Array

Stand = tuple[int | None, ...]
"""Per finger the number of its spot, None where it is free (at home)."""
Labels = tuple[int | None, ...]
"""Per finger what its contact is to the goal, as :meth:`StillContacts.label` says."""

DETOURS = 4
"""So many detours are looked for in vain around one pose of the object."""


def change_stand(stand: Stand, finger: int, spot: int | None) -> Stand:
    """Return the stand with one finger elsewhere."""
    return (*stand[:finger], spot, *stand[finger + 1 :])


@dataclass(eq=False)
class StillContacts:
    """All contacts considered while the object stands at ``X_WO`` (4, 4); answers are kept.

    ``ahead``: poses that the object comes to later, for which landings choose their spin; none where that is not asked.
    ``facing``: as in :func:`.landings.find_facing`.
    ``labels`` says of every spot whether it is a goal contact (0), one from which a goal contact is rolled to (1, 2, ..), or
    neither (None).
    """

    hand: HandModel
    X_WO: Array
    admissibility: Admissibility
    ahead: Sequence[Array] = ()
    facing: float = FACING
    spots: list[Placement] = field(default_factory=list)
    labels: list[int | None] = field(default_factory=list)
    _states: list[FingerState] = field(default_factory=list)
    _normals: list[Array] = field(default_factory=list)
    _arms: list[Array] = field(default_factory=list)
    _margins: dict[Stand, Margins] = field(default_factory=dict)
    _landings: dict[int, list[int]] = field(default_factory=dict)
    _loads: dict[tuple[int, int], Array] = field(default_factory=dict)
    _arcs: dict[int, Array] = field(default_factory=dict)
    _ways: dict[tuple[Stand, int, bool], Way] = field(default_factory=dict)
    _detours: int = 0

    def __post_init__(self) -> None:
        limits = self.hand.limits
        self.lean_max = (
            compute_pair_angle_max(self.hand.friction.scaled(limits.cone_share)) - limits.closure_margin
        )
        """Two contacts hold where their chord leans less than this [rad] from both normals."""

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
        self._arms += [self.X_WO[:3, :3] @ p.point_O for p in placements]
        return list(range(first, len(self.spots)))

    def landings(self, finger: int) -> list[int]:
        """Return places all over the object where a finger can land, as far as it alone is concerned."""
        if finger not in self._landings:
            sites = list_sites(self.hand)
            rows = find_facing(self.hand, self.X_WO, finger, sites, self.facing)
            at = sites.normals[rows], sites.points[rows]
            found = list[Placement | None]()
            for tilt in TILTS if len(self.ahead) or not self.hand.object.is_isotropic else (0.0,):
                found += build_landings(self.hand, self.X_WO, finger, *at, tilt=tilt)
            landed = center_spins(self.hand, [p for p in found if p is not None], self.ahead)
            self._landings[finger] = self.add_all(landed)
        return self._landings[finger]

    def loads(self, finger: int, partner: int) -> Array:
        """Return which share of the believed cone it takes to hold with ``partner`` and each of the landings of a finger."""
        key = finger, partner
        if key not in self._loads:
            self._loads[key] = self._compute_loads(self.pair_with(finger, partner))
        return self._loads[key]

    def list_loads(self, a: int, b: int) -> Array:
        """Return which share of the believed cone it takes to hold with landings of two fingers, (N, M) for all of both."""
        # Landings at one place differ in their tip poses alone, which the load does not ask for.
        (first, which_a), (second, which_b) = (self._list_places(self.landings(f)) for f in (a, b))
        used = self._compute_loads(pair_all(first, second)).reshape(len(first), len(second))
        return used[np.ix_(which_a, which_b)]

    def _list_places(self, spots: list[int]) -> tuple[Array, NDArray[np.intp]]:
        """Return normals and arms (N, 2, 3) in W of the places at which spots are, and which place each spot has."""
        rows = np.array([[*self._normals[s], *self._arms[s]] for s in spots]).reshape(-1, 6)
        places, which = np.unique(rows, axis=0, return_inverse=True)
        return places.reshape(-1, 2, 3), which.reshape(-1)

    def _compute_loads(self, pairs: SpotPairs) -> Array:
        """Return which share (N,) of the believed cone pairs use; inf where they are not force closed with a margin."""
        wrench = compute_object_wrench(self.hand, None, self.X_WO[:3, :3])
        return pairs.compute_closed_loads(self.hand, wrench, self.lean_max)

    def pair_with(self, finger: int, partner: int) -> SpotPairs:
        """Return the pairs of ``partner`` with each of the landings of a finger."""
        spots = self.landings(finger)
        normals, arms = (
            np.array([rows[s] for s in spots]).reshape(-1, 3) for rows in (self._normals, self._arms)
        )
        return SpotPairs(
            np.stack([np.broadcast_to(self._normals[partner], normals.shape), normals], axis=1),
            np.stack([np.broadcast_to(self._arms[partner], arms.shape), arms], axis=1),
        )

    def find_room(self, finger: int, stand: Stand) -> NDArray[np.bool_]:
        """Return at which of its landings (N,) a finger's tip has room beside those of ``stand``, and keeps their order."""
        spots = self.landings(finger)
        tips = np.array([self._states[s].X_WF[:3, 3] for s in spots]).reshape(-1, 3)
        has_room = np.ones(len(spots), dtype=bool)
        for other, spot in enumerate(stand):
            if spot is not None and other != finger:
                radii = self.hand.fingers[finger].tip_radius + self.hand.fingers[other].tip_radius
                gaps = np.linalg.norm(tips - self._states[spot].X_WF[:3, 3], axis=1) - radii
                has_room &= gaps >= self.hand.limits.clearance
        others = self._list_directions(change_stand(stand, finger, None))
        return has_room & keep_order(self.hand, {**others, finger: tips - self.X_WO[:3, 3]})

    def get_direction(self, spot: int) -> Array:
        """Return in which direction (3,) in W the tip at a spot is from the object's origin: on a ball the normal."""
        if self.hand.object.is_isotropic:
            return self._normals[spot]
        arm = self._states[spot].X_WF[:3, 3] - self.X_WO[:3, 3]
        return np.asarray(arm / np.linalg.norm(arm))

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
        arms, normals = ([rows[a], rows[b]] for rows in (self._arms, self._normals))
        return bool(measure_chord_lean(arms, normals) < self.lean_max)

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
        return keeps_order(self.hand, self._list_directions(stand))

    def _list_directions(self, stand: Stand) -> dict[int, Array]:
        """Return in which direction (3,) in W each tip is from the object's origin, those of free fingers at home."""
        directions = {f: p - self.X_WO[:3, 3] for f, p in enumerate(self.hand.p_WF_home)}
        directions.update({f: self.get_direction(s) for f, s in enumerate(stand) if s is not None})
        return directions

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
