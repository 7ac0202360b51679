"""How fast a plan turns the object, and in words why not faster."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dexplan.plans.actions import Action, MoveObject
from dexplan.plans.pace import PACES


@dataclass(frozen=True)
class SpeedLimit:
    """Motions of the object that are slower than asked for: ``limit`` in words, and the ``slowest`` and ``fastest`` [rad/s]."""

    limit: str
    slowest: float
    fastest: float


@dataclass(frozen=True)
class PlannedSpeed:
    """How fast the object turns: ``asked`` for and ``reached`` at most [rad/s]; ``limits`` of the motions that are slower."""

    asked: float
    reached: float
    limits: tuple[SpeedLimit, ...]

    @classmethod
    def of_actions(cls, actions: Iterable[Action], asked: float) -> PlannedSpeed | None:
        """Return how fast timed ``actions`` turn the object where ``asked`` [rad/s] was wanted; None where they never do."""
        speeds: dict[str, list[float]] = {}
        for action in actions:
            if isinstance(action, MoveObject) and action.motion.angle != 0.0 and action.pace is not None:
                fastest = abs(action.motion.angle) * action.pace.greatest_rate
                speeds.setdefault(action.pace.limit, []).append(fastest)
        if not speeds:
            return None
        slowed = {PACES[name]: found for name, found in speeds.items() if name != "object_speed"}
        limits = tuple(SpeedLimit(words, min(found), max(found)) for words, found in sorted(slowed.items()))
        return cls(asked, max(max(found) for found in speeds.values()), limits)

    def __str__(self) -> str:
        """Return "limited to ... by ..." for every limit that slows motions down."""
        asked = float(np.degrees(self.asked))
        parts = []
        for limit in self.limits:
            slowest, fastest = np.degrees([limit.slowest, limit.fastest])
            least = "" if fastest - slowest < 0.05 else f"{slowest:.1f} .. "
            parts.append(f"limited to {least}{fastest:.1f} deg/s by {limit.limit}")
        return f"{asked:g} deg/s asked for, {'; '.join(parts) or 'every turn is that fast'}"

    def as_dict(self) -> dict[str, Any]:
        """Return the speeds as JSON data."""
        return {
            "asked_deg_s": round(float(np.degrees(self.asked)), 9),
            "reached_deg_s": round(float(np.degrees(self.reached)), 9),
            "limits": [
                {
                    "limit": x.limit,
                    "slowest_deg_s": round(float(np.degrees(x.slowest)), 9),
                    "fastest_deg_s": round(float(np.degrees(x.fastest)), 9),
                }
                for x in self.limits
            ],
            "words": str(self),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> PlannedSpeed:
        """Return the speeds that :meth:`as_dict` described."""
        limits = tuple(
            SpeedLimit(
                x["limit"], float(np.radians(x["slowest_deg_s"])), float(np.radians(x["fastest_deg_s"]))
            )
            for x in data["limits"]
        )
        return cls(float(np.radians(data["asked_deg_s"])), float(np.radians(data["reached_deg_s"])), limits)
