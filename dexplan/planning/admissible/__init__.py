"""May the hand be here?  One state or one motion, judged by joints, clearance, forces, torques and order.

==================  ===========================================================================
``hand``            ``HandModel``: what planning knows of the world; ``Probe``: what it may ask
``limits``          ``AdmissibleLimits``: what a state must leave to spare
``admissibility``   ``Admissibility``: judges a grasp at a pose, with ``Margins``
``carry``           the same along a motion of the object
``loads``           thousands of pairs of contacts at once
``squeeze``         how hard fingers press, less in light objects
``separation``      how far apart two contacts have to be to hold alone
``order``           fingers stand around the object in the order of their bases
``tip_rotation``    the paper's rotation limit gamma of rolling tips
``rolling_hold``    ``RollingHold``: one station of contacts that roll and pivot
==================  ===========================================================================

By how much may the normals of two soft contacts be off the line through both, in degrees, at friction 0.55?

>>> import numpy as np
>>> from dexplan.contact.friction import SoftFinger
>>> from dexplan.planning.admissible.separation import compute_pair_angle_max
>>> round(float(np.degrees(compute_pair_angle_max(SoftFinger(0.55, 0.0025)))), 1)
28.8
"""

__all__ = [
    "admissibility",
    "aligned",
    "carry",
    "conditions",
    "hand",
    "limits",
    "loads",
    "lone_clearance",
    "order",
    "rolling_hold",
    "separation",
    "squeeze",
    "tip_rotation",
]
