"""What a search answers with: a link of a gait, not yet made into actions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from dexplan.planning.ways.travel import Way
from dexplan.plans.contacts import Placement
from dexplan.spatial import Array, lock_arrays


@dataclass(frozen=True, eq=False)
class Step:
    """One link of the search's answer: perhaps a substitution, then a turn of the object with the new grasp.

    ``contacts`` hold during the motion from ``X_WO_start`` to ``X_WO_end``, a turn by ``angle`` [rad] about ``axis_W`` (None: the
    axis of the whole gait) or a straight shift; before it ``placed`` came down and finger ``lifted`` went up, as part of a finger
    rewind if ``is_rewind``.  ``limit`` is the limiting finger (or None) and what ended the motion.  ``ways`` holds by finger the
    ways between home and hover that are not the arc.
    """

    contacts: tuple[Placement, ...]
    X_WO_start: Array
    X_WO_end: Array
    angle: float
    placed: Placement | None
    lifted: int | None
    limit: tuple[int | None, str]
    margins: Mapping[str, float] = field(default_factory=dict)
    place_margins: Mapping[str, float] = field(default_factory=dict)
    axis_W: Array | None = None
    is_rewind: bool = False
    ways: Mapping[int, Way] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def is_still(self) -> bool:
        """Whether the object stays where it is."""
        return self.angle == 0.0 and np.array_equal(self.X_WO_start[:3, 3], self.X_WO_end[:3, 3])
