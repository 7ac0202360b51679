"""How fast the object turns in a reference, and which of the many limits kept it from turning faster."""

from __future__ import annotations

from dexplan.control.reference import Reference
from dexplan.plans.speed import PACES, PlannedSpeed, SpeedLimit


def compute_speed(reference: Reference) -> PlannedSpeed | None:
    """Return how fast the object turns in ``reference``, and what keeps it from turning faster; None where it never turns."""
    speeds: dict[str, list[float]] = {}
    for phase in reference.phases:
        path = phase.object_path
        if path.angle != 0.0:
            fastest = abs(path.angle) / (path.duration - min(path.ramp, 0.5 * path.duration))
            speeds.setdefault(phase.pace, []).append(fastest)
    if not speeds:
        return None
    slowed = {name: found for name, found in speeds.items() if name != PACES["object_speed"]}
    limits = tuple(SpeedLimit(name, min(found), max(found)) for name, found in sorted(slowed.items()))
    return PlannedSpeed(reference.timing.object_speed, max(max(found) for found in speeds.values()), limits)
