"""Grips of rolling contacts judged at the stations of the object's way, at rest and while they carry."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dexplan.planning.admissible.admissibility import Margins, worst
from dexplan.planning.admissible.rolling_hold import REST, RollingHold, Station, TouchState
from dexplan.planning.contacts.oracle import Progress, Verdict
from dexplan.planning.contacts.rolling_touches import RollingTouches
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.spatial import Array

RollingGrip = tuple[int | None, ...]
"""Per finger the number of its touch, None where it is free (at home)."""
SLIP_CAP = 5e-4
"""How far a tip may slide on the object in one carry, by the law of pivoting contacts [m]; MuJoCo is within 10 % of it."""


@dataclass(eq=False)
class RollingStations:
    """Judges grips along the way of ``touches``; answers are kept.  ``slip_cap`` [m]: how far a tip may slide in a carry."""

    touches: RollingTouches
    hold: RollingHold
    slip_cap: float = SLIP_CAP
    _found: dict[tuple[RollingGrip, int, bool], Station] = field(default_factory=dict, init=False)

    def list_states(self, grip: RollingGrip, station: int) -> list[TouchState]:
        """Return the contacts of a grip at a station."""
        return [self.touches.touches[t].at(station) for t in grip if t is not None]

    def judge(self, grip: RollingGrip, station: int, is_moving: bool) -> Station:
        """Return what was found of a grip at a station, while the object rests or goes on."""
        key = grip, station, is_moving
        if key not in self._found:
            known = self.touches
            twist = known.compute_twist(station) if is_moving else REST
            self._found[key] = self.hold.judge(
                self.list_states(grip, station), known.stations[station], twist
            )
        return self._found[key]

    def judge_carry(self, grip: RollingGrip, at: Progress, stops: int, is_thorough: bool) -> Verdict:
        """Return the worst margins of a carry, or the first refusal; not ``is_thorough``: the stops alone are looked at."""
        marks = self.touches.stops[at.stop : at.stop + stops + 1]
        looks = np.arange(marks[0], marks[-1] + 1) if is_thorough else marks
        rows = list[Margins]()
        for station in looks.tolist():
            margins = self.judge(grip, station, is_moving=True).margins
            if margins.refusal is not None:
                return Verdict(worst(rows), margins.refusal)
            rows.append(margins)
        slips = self._sum_slips(grip, looks.tolist())
        if slips.max() > self.slip_cap:
            name = self.touches.hand.fingers[int(slips.argmax())].name
            refusal = Refusal(RefusalKind.PIVOT_SLIP, (name,), float(slips.max()), self.slip_cap)
            return Verdict(worst(rows), refusal)
        return Verdict(worst(rows))

    def measure_slips(self, grip: RollingGrip, at: Progress, stops: int) -> Array:
        """Return how far (F,) [m] every tip slides in a carry by the law, summed over all stations with planned forces."""
        first, last = int(self.touches.stops[at.stop]), int(self.touches.stops[at.stop + stops])
        return self._sum_slips(grip, list(range(first, last + 1)))

    def _sum_slips(self, grip: RollingGrip, looks: list[int]) -> Array:
        out, touching = np.zeros(len(grip)), [(f, t) for f, t in enumerate(grip) if t is not None]
        rates = []
        for station in looks:
            forces = self.judge(grip, station, is_moving=True).forces
            assert forces is not None
            rates.append(forces.slip_per_turn)
        for k, (finger, touch) in enumerate(touching):
            pivots = np.array([self.touches.touches[touch].get_pivot(station) for station in looks])
            rate = np.array([row[k] for row in rates])
            out[finger] = np.sum(0.5 * (rate[1:] + rate[:-1]) * np.abs(np.diff(pivots)))
        return out
