"""Why this finger and this place: what would have come instead, and why it did not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dexplan.brief import brief_repr
from dexplan.plans.refusal import Refusal
from dexplan.spatial import Array, angles_from_direction, read_only

DIGITS = 12
"""Decimals of what is written to plan.json."""
NOTABLE = 0.05
"""Placements that seem to be missing, and shares of a cone, that differ by less are told as equal."""


@dataclass(frozen=True, eq=False)
class RunnerUp:
    """The best placement that was not taken: ``finger``, and ``normal_W`` (3,), the direction from the object's centre in W.

    ``refusal`` is why it cannot be; None where it was only ranked behind.  ``missing`` and ``missing_here`` are how many
    placements seemed to be missing to the goal after it and after the one taken; ``used`` and ``used_here`` the shares of the
    believed cone that the two grasps use; ``extra`` how many placements dearer the way to it is.
    """

    finger: int
    normal_W: Array
    refusal: Refusal | None
    missing: float
    missing_here: float
    used: float
    used_here: float
    extra: float

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal_W", read_only(self.normal_W))

    def __str__(self) -> str:
        az, el = angles_from_direction(self.normal_W)
        who = f"finger {self.finger + 1} at azimuth {az:.1f}, elevation {el:.1f} deg (world)"
        if self.refusal is not None:
            return f"{who} cannot: {self.refusal}"
        if self.extra >= NOTABLE:
            return f"{who} has a way that counts {self.extra:.0f} placements more"
        if self.missing - self.missing_here >= NOTABLE:
            return (
                f"{who} seems to leave {self.missing:.1f} placements to the goal, "
                f"this one {self.missing_here:.1f}"
            )
        if self.used - self.used_here >= NOTABLE:
            return f"{who} uses {self.used:.2f} of the believed cone, this one {self.used_here:.2f}"
        return f"{who} promises about as much, and its turn never came"

    def as_dict(self, fingers: Sequence[str]) -> dict[str, Any]:
        """Return the value as JSON data; ``fingers`` are the names of all fingers."""
        return {
            "finger": fingers[self.finger],
            "normal_W": np.round(self.normal_W, DIGITS).tolist(),
            "refusal": None if self.refusal is None else self.refusal.as_dict(),
            "missing": [round(self.missing_here, 6), round(self.missing, 6)],
            "cone_used": [round(self.used_here, 6), round(self.used, 6)],
            "extra_placements": round(self.extra, 6),
            "text": str(self),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], fingers: Sequence[str]) -> RunnerUp:
        """Return the value that :meth:`as_dict` described.  Raises LookupError, TypeError or ValueError for anything else."""
        (missing_here, missing), (used_here, used) = data["missing"], data["cone_used"]
        return cls(
            list(fingers).index(data["finger"]),
            np.array(data["normal_W"], dtype=np.float64),
            None if data["refusal"] is None else Refusal.from_dict(data["refusal"]),
            float(missing),
            float(missing_here),
            float(used),
            float(used_here),
            float(data["extra_placements"]),
        )
