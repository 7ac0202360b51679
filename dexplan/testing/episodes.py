"""Contact episodes: from the first touch of two parties until they part, short gaps bridged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dexplan.brief import brief_repr
from dexplan.spatial import Array, lock_arrays
from dexplan.testing.measurement import Measurement
from dexplan.testing.parties import Indices
from dexplan.testing.rows import PairRows


@dataclass(frozen=True, eq=False)
class Episode:
    """One touch of party ``by`` on party ``on``.

    ``rows`` (K,) are its rows of ``pairs``, in order of time, and ``duration`` (K,) [s] the time until the next one, so
    that what moves while a sliding contact hops is counted;
    ``start_s``, ``end_s``.  ``gaps`` short losses are bridged.  ``is_lost``: it ended before the record did.
    """

    on: int
    by: int
    pairs: PairRows
    rows: Indices
    duration: Array
    start_s: float
    end_s: float
    gaps: int
    is_lost: bool

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def find_episodes(measured: Measurement, gap_s: float) -> list[Episode]:
    """Return the episodes of a run, in order of their start; a gap of at most ``gap_s`` does not end one."""
    pairs, time = measured.pairs(), measured.time
    if not len(pairs.sample):
        return []
    spacing = np.diff(time)
    step = np.append(spacing, spacing[-1] if len(spacing) else measured.physics.timestep)
    key = pairs.on * len(measured.parties.names) + pairs.by
    out = []
    for pair in np.unique(key):
        rows = np.flatnonzero(key == pair)
        samples = pairs.sample[rows]
        when = time[samples]
        has_gap = np.diff(samples) > 1
        is_parted = has_gap & (np.diff(when) > gap_s + step[samples[:-1]])
        for part in np.split(np.arange(len(rows)), np.flatnonzero(is_parted) + 1):
            last = samples[part[-1]]
            out.append(
                Episode(
                    on=int(pairs.on[rows[0]]),
                    by=int(pairs.by[rows[0]]),
                    pairs=pairs,
                    rows=rows[part],
                    duration=np.append(np.diff(when[part]), step[last]),
                    start_s=float(when[part[0]]),
                    end_s=float(time[last] + step[last]),
                    gaps=int(np.count_nonzero(has_gap[part[:-1]])),
                    is_lost=bool(time[-1] - time[last] > gap_s),
                )
            )
    return sorted(out, key=lambda episode: (episode.start_s, episode.on, episode.by))
