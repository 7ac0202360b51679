"""The kinds of finger that a hand can be made of: which part of ``models/`` each is, and how it stands around the object."""

from __future__ import annotations

from dataclasses import dataclass

SIX_HINGES, TRIFINGER_PRO = "six_hinges", "trifinger"


@dataclass(frozen=True)
class FingerModel:
    """One kind of finger: the file ``part`` in ``models/`` and its ``n_joints``.

    A base stands ``base_distance`` [m] from the middle of the hand, in the direction of its azimuth, and ``base_height`` [m]
    above the floor; the part's x axis points ``turn_deg`` [deg] off that azimuth.  The object's home is ``object_height`` [m]
    above the floor.
    """

    part: str
    n_joints: int
    base_distance: float
    base_height: float
    turn_deg: float
    object_height: float


FINGER_MODELS = {
    SIX_HINGES: FingerModel("finger", 6, 0.18, 0.21, 180.0, 0.16),
    # The azimuth of a TriFinger finger is that of its own y axis, in whose direction its links stand off the common centre.
    TRIFINGER_PRO: FingerModel("trifinger", 3, 0.0, 0.29, -90.0, 0.10),
}
"""Every kind by the name that ``SceneParameters.finger`` takes."""
