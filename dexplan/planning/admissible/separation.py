"""How far apart on the object two contacts have to be to hold alone [paper §3, result 2]."""

from __future__ import annotations

import numpy as np

from dexplan.contact.friction import SoftFinger


def compute_pair_angle_max(friction: SoftFinger) -> float:
    """Return the largest angle [rad] between a contact normal and the chord of a pair that friction allows: atan mu.

    On a sphere two contacts at central angle phi make ``90 deg - phi / 2`` with their chord, so this is
    ``phi >= 180 deg - 2 atan mu`` [paper §3, result 2].
    """
    return float(np.arctan(friction.sliding))


def compute_opposition(beta_max: float) -> float:
    """Return what the cosine between one contact's normal and the opposite of the other's has to exceed for the two to hold.

    ``beta_max`` [rad] is the largest angle between normals and chord that counts.  Where friction is so low that the margin kept
    leaves no such angle (0 or less) this is infinite: no two contacts hold alone.
    """
    return float(np.cos(2.0 * beta_max)) if beta_max > 0.0 else float(np.inf)


def describe_separation(beta_max: float, sliding: float) -> str:
    """Return in words how far two contacts have to be apart to hold alone, or that with this ``sliding`` friction none do.

    To follow "contacts" or "contacts have to be".  ``beta_max`` [rad] as for ``compute_opposition``.
    """
    if beta_max <= 0.0:
        return (
            f"far enough apart (with the believed friction of {sliding:.3g} and the margin kept no two contacts hold alone, "
            "not even opposite ones)"
        )
    angle = np.degrees(np.pi - 2.0 * beta_max)
    return f"{angle:.1f} deg or more apart, as force closure with the believed friction and a margin needs"
