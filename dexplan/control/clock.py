"""Which phase of the plan holds now: phases follow one another by their durations, and by touch where a finger comes down."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dexplan.control.reference import Phase, Reference


class PlanTime(NamedTuple):
    """Where in the plan a tick is: ``t`` [s] after the beginning of ``phase``.

    ``entered`` are the indices of the phases that began with this tick, in order; ``is_done`` once the last one has ended;
    ``failure`` says what kept a phase from ending.
    """

    phase: Phase
    t: float
    is_done: bool
    failure: str | None
    entered: Sequence[int]


class PlanClock:
    """Goes through the phases of a reference.  Call :meth:`advance` once per tick, in order."""

    def __init__(self, reference: Reference, fingers: Sequence[str], tick: float) -> None:
        """``fingers`` are their names, for words; ``tick`` is the control period [s]."""
        self._phases, self._timeout = reference.phases, reference.touchdown.timeout
        self._fingers, self._half_tick = fingers, 0.5 * tick
        self.restart()

    def restart(self) -> None:
        """Be as before the first tick."""
        self._index, self._start = -1, 0.0

    def advance(self, time: float, touching: NDArray[np.bool_]) -> PlanTime:
        """Return where in the plan the tick at ``time`` [s] is, with ``touching`` (F,) as sensed."""
        entered, failure, last = [], None, len(self._phases) - 1
        if self._index < 0:
            self._index, self._start = 0, time
            entered.append(0)
        while True:
            phase, t = self._phases[self._index], time - self._start
            if phase.ends_on_touch:
                assert phase.finger is not None
                over = bool(touching[phase.finger])
                if t > phase.duration + self._timeout:
                    failure = f"{self._fingers[phase.finger]} found no object where it should have touched"
            else:
                over = t > phase.duration - self._half_tick
            if not over or self._index == last:
                return PlanTime(phase, t, over and self._index == last, failure, entered)
            self._index, self._start = self._index + 1, time
            entered.append(self._index)
