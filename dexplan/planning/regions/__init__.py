"""Where on the object may a finger touch, and what do the paper's theorems say of it?

===============  ==========================================================================================
``regions``      ``compute_regions``: for each finger where it can touch (CWS) and with whom it can hold (FC)
``spherical``    ``SphericalRegion``: regions of directions with set operations, area and exact membership
``theorems``     ``check_theorem_1``, ``check_theory_3``: can gaits and rewinds go on?  with witness points
``sampling``     random attitudes and start contacts
===============  ==========================================================================================

A cap of 57.6 degrees around an axis, which is where a second soft finger has to be at friction 0.55; its share of the sphere:

>>> import numpy as np
>>> from dexplan.planning.regions.spherical import build_cap
>>> cap = build_cap([0.0, 0.0, 1.0], np.radians(57.6))
>>> bool(cap.contains(np.array([0.0, 0.0, 1.0]))), bool(cap.contains(np.array([1.0, 0.0, 0.0])))
(True, False)
"""

from dexplan.moved import forward

__all__ = ["regions", "sampling", "spherical", "theorems"]

__getattr__ = forward(__name__, ["dexplan.planning.regions.regions", "dexplan.planning.admissible.order"])
