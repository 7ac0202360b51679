"""From here to there by rolling: the shortest way a spherical tip can go on a ball within its limits, or why there is none."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dexplan.brief import brief_repr
from dexplan.contact.rolling.candidates import (
    SMALL,
    Candidate,
    Outset,
    RollLimits,
    compute_reach,
    generate_candidates,
)
from dexplan.contact.rolling.curves import RollingPath, roll_along, split_start
from dexplan.contact.rolling.turning import any_tangent, build_turn, make_tangent
from dexplan.contact.surfaces.shapes import Sphere
from dexplan.errors import spell_apart
from dexplan.spatial import Array

RollStatus = Literal["found", "start_beyond_limit", "start_not_admissible", "out_of_reach", "not_admissible"]

RollEnd = Literal["free", "pole", "pole_without_spin"]
"""How a tip stands at the end: anyhow; with its pole on the contact; with its pole there and without having spun, relative to
parallel transport along the great circle of the triangles (mirrored pairs, or lifts)."""

Admissible = Callable[[Array], NDArray[np.bool_]]
"""``is_admissible(X_OF)``: which of the tip poses (K, 4, 4) the rest of the world allows, (K,)."""

_ON_POLE = 1e-8  # a contact this near the tip's pole [rad] is on it: no way towards it is distinguished
_OPPOSITE_DIRECTIONS = 12  # ways that are tried to a goal on the other side of the ball


@dataclass(frozen=True, eq=False)
class RollPlan:
    """Answer of :func:`roll_to`.

    ``paths``: the ways between lifts, one without lifts, none where nothing was found.  ``kind`` names it, ``reason`` says why
    it was chosen, or why there is none and what would help.  ``tried`` is how many ways were looked at.
    """

    status: RollStatus
    reason: str
    kind: str = ""
    paths: tuple[RollingPath, ...] = ()
    tried: int = 0

    __repr__ = brief_repr

    @property
    def is_found(self) -> bool:
        """Whether there is a way."""
        return self.status == "found"

    @property
    def path(self) -> RollingPath:
        """The way, if it needs no lift; raises ValueError otherwise."""
        if len(self.paths) != 1:
            raise ValueError(
                f"{len(self.paths)} paths ({self.status}: {self.reason}); a way without lifts has one"
            )
        return self.paths[0]

    @property
    def total_length(self) -> float:
        """What is rolled [m]."""
        return sum(path.total_length for path in self.paths)


def roll_to(
    start: ArrayLike,
    goal: ArrayLike,
    tip: Sphere,
    ball: Sphere,
    limits: RollLimits,
    *,
    end: RollEnd = "free",
    is_admissible: Admissible | None = None,
) -> RollPlan:
    """Plan how the tip rolls, without sliding or spin, until it touches the ball at ``goal``.

    The shortest admissible of these ways, by what is rolled: straight along the great circle; a bend (two legs); the pole
    first, then straight or bent; rolling triangles with the longest leg the polar limit allows (A-B-C-D where that is 90
    degrees) or shorter ones, repeated as often as needed along the great circle to the goal, mirrored every second time or
    not, then straight or bent for the rest.  It is the shortest **of these**; no claim is made about all curves.

    Args:
        start: X_OF (4, 4), the tip touching the ball (up to 1 % off, see ``roll_along``).
        goal: (3,) direction from the ball's centre in O: the outward normal at the goal contact.
        tip: the fingertip.
        ball: the object.
        limits: how far the contact may go from the tip's pole, how wide a triangle may be, how many cycles and lifts, how many
            ways are looked at and how finely they are sampled.
        end: how the tip has to stand at the goal, see :data:`RollEnd`.
        is_admissible: which tip poses are possible, asked along the whole way (reach of the finger, clearance).

    Returns:
        The plan; its status and reason say truthfully when there is none: ``start_beyond_limit``, ``start_not_admissible``,
        ``out_of_reach`` (geometry and limits), ``not_admissible`` (the ways there are, are vetoed).

    Raises:
        ValueError: the start does not touch, the goal is zero, or ``end`` is none of :data:`RollEnd`.
    """
    if end not in get_args(RollEnd):
        raise ValueError(f"end {end!r}; {', '.join(map(repr, get_args(RollEnd)))} are accepted")
    is_pole_at_end, is_spin_cancelled = end != "free", end == "pole_without_spin"
    X = np.array(start, dtype=np.float64)
    _, n = split_start(tip.radius, ball.radius, X)
    X[:3, 3] = (tip.radius + ball.radius) * n
    goal = ball.radial(goal) / ball.radius
    off = _measure_lean(X, n, (tip.radius, ball.radius))
    if off > limits.tip_polar_limit + SMALL:
        given, most = spell_apart(np.degrees(off), np.degrees(limits.tip_polar_limit))
        return RollPlan(
            "start_beyond_limit",
            f"the contact starts {given} degrees off the tip's pole; at most {most} is accepted",
        )
    if is_admissible is not None and not is_admissible(X[None]).all():
        return RollPlan(
            "start_not_admissible", "the start pose itself is not admissible; another start is accepted"
        )

    outsets = list(_find_outsets(X, goal, (tip.radius, ball.radius), limits, is_pole_at_end))
    candidates = [c for o in outsets for c in _start_straight(o, limits, is_pole_at_end, off)]
    # A straight way is the shortest there is: the others are worked out only where it does not do.
    tried, best = 0, ("", 0.0)
    for group in (candidates, None):
        if group is None:
            group = [
                c for o in outsets for c in generate_candidates(o, limits, is_pole_at_end, is_spin_cancelled)
            ]
        for candidate in sorted(group, key=lambda c: c.length):
            if tried >= limits.max_tries:
                break
            paths = candidate.build(limits.samples)
            # Farthest from the pole along a great circle are its ends, which are samples, as long as that is below 90 degrees.
            if max(path.polar_angle.max() for path in paths) > limits.tip_polar_limit + 1e-9:
                continue
            tried += 1
            share = 1.0 if is_admissible is None else _measure_admissible(paths, is_admissible)
            if share >= 1.0:
                reason = f"shortest of the ways looked at: {1e3 * candidate.length:.4g} mm rolled"
                return RollPlan("found", reason, candidate.kind, paths, tried)
            best = max(best, (candidate.kind, share), key=lambda b: b[1])
    distance = np.degrees(max(o.distance for o in outsets[:1]))
    if tried:
        more = f"; max_tries {limits.max_tries} was used up" if tried >= limits.max_tries else ""
        return RollPlan(
            "not_admissible",
            f"{tried} ways lead to the goal, {distance:.4g} degrees away, and none is admissible all along; "
            f"the best ({best[0]}) is for its first {100 * best[1]:.3g} %{more}",
            tried=tried,
        )
    reach = np.degrees(max(compute_reach(o, limits, is_pole_at_end, is_spin_cancelled) for o in outsets))
    return RollPlan(
        "out_of_reach",
        f"the goal is {distance:.4g} degrees away on the ball and at most about {reach:.3g} can be rolled"
        f"{' with the pole at the end' if is_pole_at_end else ''} in {limits.max_cycles} cycles "
        f"with tip_polar_limit {np.degrees(limits.tip_polar_limit):.4g} and "
        f"tip_rotation_limit {np.degrees(limits.tip_rotation_limit):.4g} degrees; "
        f"{_advise(tip, ball, is_spin_cancelled)}",
    )


def _measure_lean(X: Array, n: Array, radii: tuple[float, float]) -> float:
    """Return how far [rad] the contact along ``n`` (3,) is from the tip's pole."""
    return float(roll_along(*radii, X, [n], 2).polar_angle[0])


def _find_outsets(
    X: Array, goal: Array, radii: tuple[float, float], limits: RollLimits, is_pole_at_end: bool
) -> Iterator[Outset]:
    """Yield where triangles can begin: here, and where the pole has been rolled onto the contact."""
    R_OF, n = split_start(*radii, X)
    off = _measure_lean(X, n, radii)
    if off < _ON_POLE or not is_pole_at_end:
        yield from _aim(X, goal, radii, limits.tip_polar_limit - off, None)
    if off >= _ON_POLE:
        # The contact runs the same way in space on both bodies: towards the pole on the tip is this way on the ball.
        heading = R_OF @ make_tangent(-R_OF.T @ n, [0.0, 0.0, 1.0]) if off < np.pi - 1e-9 else any_tangent(n)
        under = build_turn(np.cross(n, heading), off * radii[0] / radii[1]) @ n
        before = roll_along(*radii, X, [under])
        yield from _aim(before.X_OF[-1], goal, radii, limits.tip_polar_limit, before)


def _aim(
    X: Array, goal: Array, radii: tuple[float, float], leg_max: float, before: RollingPath | None
) -> Iterator[Outset]:
    n = X[:3, 3] / np.linalg.norm(X[:3, 3])
    sine = float(np.linalg.norm(np.cross(n, goal)))
    distance = float(np.arctan2(sine, n @ goal))
    directions = [goal]
    if sine < 1e-9:
        first = any_tangent(n)
        count = _OPPOSITE_DIRECTIONS if n @ goal < 0.0 else 1
        directions = [build_turn(n, 2.0 * np.pi * k / count) @ first for k in range(count)]
    for direction in directions:
        yield Outset(radii, X, goal, direction, distance, max(leg_max, 0.0), before)


def _start_straight(
    outset: Outset, limits: RollLimits, is_pole_at_end: bool, off: float
) -> Iterator[Candidate]:
    """Yield the straight way from the start, or staying there."""
    if outset.before or (is_pole_at_end and off >= _ON_POLE):
        return
    if outset.distance < SMALL:
        yield Candidate(outset, 0.0)
        return
    r, R = outset.radii
    # From pole to pole across the tip is all a hemisphere can do.
    if (
        not is_pole_at_end
        and outset.distance <= (limits.tip_polar_limit + off) * r / R + SMALL
        and outset.distance < 3.1
    ):
        yield Candidate(outset, outset.distance * R, is_straight_at_end=True)


def _measure_admissible(paths: tuple[RollingPath, ...], is_admissible: Admissible) -> float:
    """Return the share of the samples before the first that is not admissible."""
    X = np.concatenate([path.X_OF for path in paths])
    mask = np.asarray(is_admissible(X), dtype=bool)
    if mask.shape != (len(X),):
        raise ValueError(
            f"is_admissible returned shape {mask.shape} for {len(X)} poses; {(len(X),)} is accepted"
        )
    return 1.0 if mask.all() else float(np.argmin(mask)) / len(X)


def _advise(tip: Sphere, ball: Sphere, is_spin_cancelled: bool) -> str:
    if abs(tip.radius - ball.radius) < 1e-6 * ball.radius:
        return "triangles get ahead only with a tip that is not as large as the ball"
    more = "more cycles, more lifts" if is_spin_cancelled else "more cycles"
    return f"{more}, wider limits or a nearer goal would help"
