"""Ways for a spherical tip to roll a ball's length ahead within its limits: straight, with a bend, with rolling triangles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, pi

from scipy.optimize import brentq

from dexplan.brief import brief_repr
from dexplan.contact.rolling.curves import SAMPLES, RollingPath, join_paths, roll_along
from dexplan.contact.rolling.manoeuvre import RollingBend, RollingTriangle, chain_triangles, solve_apex
from dexplan.contact.rolling.turning import build_turn
from dexplan.spatial import Array, lock_arrays

LEG_SHARES = (1.0, 0.85, 0.7, 0.55, 0.4)
"""Legs that are tried, as shares of the longest: shorter ones get less far but may suit the hand where the longest does not."""

SMALL = 1e-10
"""Angles [rad] below which nothing has to be rolled."""


@dataclass(frozen=True)
class RollLimits:
    """What a tip may do while it rolls.

    ``tip_polar_limit`` [rad]: largest angle between the tip's pole and the contact on it, at most pi/2 (a hemisphere).
    ``tip_rotation_limit`` [rad]: the paper's gamma, how far the tip may roll along its equator: the largest apex of a
    triangle.  ``max_cycles``: triangles in one way; ``max_lifts``: how often the tip may leave the ball to be turned back on
    the spot.  ``max_tries``: ways, in order of length, that are looked at before giving up; ``samples``: about how many samples
    a part of a way has.

    Raises ValueError for values outside these ranges.
    """

    tip_polar_limit: float
    tip_rotation_limit: float
    max_cycles: int = 12
    max_lifts: int = 0
    max_tries: int = 100
    samples: int = SAMPLES

    def __post_init__(self) -> None:
        if not 0.0 < self.tip_polar_limit <= 0.5 * pi + 1e-12:
            raise ValueError(
                f"tip_polar_limit is {self.tip_polar_limit} rad; more than 0 and at most pi/2 is accepted"
            )
        if not 0.0 <= self.tip_rotation_limit < pi:
            raise ValueError(
                f"tip_rotation_limit is {self.tip_rotation_limit} rad; from 0 to less than pi is accepted"
            )
        if self.max_cycles < 0 or self.max_lifts < 0:
            raise ValueError(
                f"max_cycles {self.max_cycles}, max_lifts {self.max_lifts}; 0 or more is accepted"
            )
        if self.max_tries < 1 or self.samples < 2:
            raise ValueError(
                f"max_tries {self.max_tries}, samples {self.samples}; from 1 and from 2 on is accepted"
            )


@dataclass(frozen=True, eq=False)
class Outset:
    """Where triangles begin: the touching pose ``X_OF``, what was rolled to get there, and how far the goal is.

    ``radii`` [m] of tip and ball; ``goal`` (3,) unit normal in O; ``direction`` (3,) sets off towards it: the goal itself, or
    any direction where the goal is opposite; ``distance`` [rad] to the goal on the ball; ``leg_max`` [rad]: every way out from
    the contact stays within the tip's polar limit for so long.
    """

    radii: tuple[float, float]
    X_OF: Array
    goal: Array
    direction: Array
    distance: float
    leg_max: float
    before: RollingPath | None

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def length(self) -> float:
        """What was rolled to get here [m]."""
        return self.before.total_length if self.before else 0.0


@dataclass(frozen=True, eq=False)
class Candidate:
    """A way to the goal: triangles along the great circle to it, then a straight roll or a bend for the rest, or nothing.

    With ``lifts`` the tip is turned back on the spot after each cycle, as many as there are; ``length`` [m] is what is rolled.
    """

    outset: Outset
    length: float
    cycles: tuple[RollingTriangle, ...] = ()
    lifts: int = 0
    bend: RollingBend | None = None
    is_straight_at_end: bool = False

    __repr__ = brief_repr

    @property
    def kind(self) -> str:
        """What it is, in words: L and R are triangles that turn left and right."""
        parts = ["pole first"] if self.outset.before else []
        if self.cycles:
            parts.append("triangles " + "".join("L" if c.apex > 0.0 else "R" for c in self.cycles))
        if self.is_straight_at_end:
            parts.append("straight")
        if self.bend:
            parts.append("bend")
        if self.lifts:
            parts.append(f"lifts {self.lifts}")
        return ", ".join(parts) if parts else "stay"

    def build(self, samples: int) -> tuple[RollingPath, ...]:
        """Return the paths between lifts, about ``samples`` for each of their parts."""
        outset = self.outset
        groups: list[list[RollingPath]] = [[outset.before] if outset.before else []]
        X = outset.X_OF
        if self.cycles:
            rolled = chain_triangles(self.cycles, X, outset.direction, self.lifts > 0, samples)
            groups[-1].append(rolled[0])
            groups.extend([path] for path in rolled[1:])
            X = rolled[-1].X_OF[-1]
            if self.lifts == len(self.cycles):
                # The last lift turns the tip back and puts it down to stay.
                X = X.copy()
                X[:3, :3] = build_turn(rolled[-1].n_O[-1], -self.cycles[-1].spin) @ X[:3, :3]
                groups.append([])
        if self.bend:
            groups[-1].append(self.bend.roll(X, outset.goal if self.cycles else outset.direction, samples))
        elif self.is_straight_at_end:
            groups[-1].append(roll_along(*outset.radii, X, [outset.goal], samples))
        elif not groups[-1]:
            groups[-1].append(roll_along(*outset.radii, X, [X[:3, 3]], 2))
        return tuple(join_paths(group) for group in groups)


def generate_candidates(
    outset: Outset, limits: RollLimits, is_pole_at_end: bool, is_spin_cancelled: bool
) -> Iterator[Candidate]:
    """Yield the ways from ``outset`` to its goal that geometry and limits allow, but for a straight roll from the start.

    Of each kind (no rest, straight rest, bent rest; legs as :data:`LEG_SHARES`) the fewest cycles that suffice, and one more;
    of those both hands, mirrored and not, and with lifts where they are allowed.
    """
    (r, R), gamma, D = outset.radii, limits.tip_rotation_limit, outset.distance
    if D < SMALL and outset.before:
        yield Candidate(outset, outset.length)
        return
    straight = 0.0 if is_pole_at_end else outset.leg_max * r / R
    if outset.before and straight >= D:
        yield Candidate(outset, outset.length + D * R, is_straight_at_end=True)
    for leg in _choose_legs(outset, limits):
        widest = RollingTriangle(r, R, leg, gamma)
        # (rest [rad], the bend that covers it): nothing, straight as far as the pole allows, the widest bend.
        rests: list[tuple[float, RollingBend | None]] = [(0.0, None)]
        if not is_pole_at_end:
            yield from _bend_alone(outset, leg, gamma)
            bend = RollingBend(widest)
            rests += [
                (rest, b) for rest, b in ((straight, None), (bend.displacement, bend)) if SMALL < rest < D
            ]
        for rest, bend_at_end in rests:
            ahead = widest.displacement
            fewest = max(1, ceil((D - rest) / ahead - 1e-9)) if ahead > SMALL else limits.max_cycles + 1
            for count in range(fewest, min(fewest + 1, limits.max_cycles) + 1):
                apex = solve_apex(r, R, leg, (D - rest) / count, gamma)
                if apex is None:
                    continue
                length = outset.length + count * RollingTriangle(r, R, leg, apex).total_length
                length += bend_at_end.total_length if bend_at_end else rest * R
                for hands, lifts in _choose_hands(count, limits.max_lifts, is_spin_cancelled):
                    cycles = tuple(RollingTriangle(r, R, leg, apex * hand) for hand in hands)
                    yield Candidate(
                        outset, length, cycles, lifts, bend_at_end, bend_at_end is None and rest > 0.0
                    )


def compute_reach(outset: Outset, limits: RollLimits, is_pole_at_end: bool, is_spin_cancelled: bool) -> float:
    """Return the farthest goal [rad on the ball] that the candidates from an outset reach."""
    r, R = outset.radii
    rest = 0.0 if is_pole_at_end else outset.leg_max * r / R
    ahead = 0.0
    for leg in _choose_legs(outset, limits):
        widest = RollingTriangle(r, R, leg, limits.tip_rotation_limit)
        rest = rest if is_pole_at_end else max(rest, RollingBend(widest).displacement)
        ahead = max(ahead, widest.displacement)
    cycles = limits.max_cycles
    if is_spin_cancelled:
        # Mirrored pairs, or a lift for each.
        cycles = max(cycles - cycles % 2, min(cycles, limits.max_lifts))
    return rest + cycles * ahead


def _choose_legs(outset: Outset, limits: RollLimits) -> list[float]:
    legs = [min(share * outset.leg_max, 0.5 * pi) for share in LEG_SHARES]
    return [leg for leg in legs if leg > 1e-6] if limits.tip_rotation_limit > 1e-6 else []


def _choose_hands(
    count: int, max_lifts: int, is_spin_cancelled: bool
) -> Iterator[tuple[tuple[int, ...], int]]:
    """Yield (handedness of each cycle, lifts)."""
    for hand in (1, -1):
        mirrored = tuple(hand * (-1) ** k for k in range(count))
        if not is_spin_cancelled or count % 2 == 0:
            yield mirrored, 0
        if count > 1 and not is_spin_cancelled:
            yield (hand,) * count, 0
        lifts = count if is_spin_cancelled else count - 1
        if 0 < lifts <= max_lifts:
            yield (hand,) * count, lifts


def _bend_alone(outset: Outset, leg: float, gamma: float) -> Iterator[Candidate]:
    """Yield the two bends with this leg that end on the goal."""

    def excess(apex: float) -> float:
        return RollingBend(RollingTriangle(*outset.radii, leg, apex)).displacement - outset.distance

    if gamma <= 1e-6 or excess(1e-6) * excess(gamma) > 0.0:
        return
    apex = float(brentq(excess, 1e-6, gamma, xtol=1e-15, rtol=1e-14))
    for hand in (1, -1):
        bend = RollingBend(RollingTriangle(*outset.radii, leg, hand * apex))
        yield Candidate(outset, outset.length + bend.total_length, bend=bend)
