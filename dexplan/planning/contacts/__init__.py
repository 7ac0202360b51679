"""What can land where, be carried how far, and hold with what: the oracle that a search of grasps asks.

====================  =============================================================================================
``oracle``            ``Contacts``: the protocol, and the values in it
``orbit_contacts``    ``OrbitContacts``: the oracle for bodies that look the same all around the axes of their way
``site_contacts``     ``SiteContacts``: the oracle for any way of the object, at poses one after another
``legs``              the object's path as legs, which contacts go along in stations
``contact_table``     ``ContactTable``: the contacts of one leg, on orbits of a body that looks the same all around
``candidates``        ``find_landings``: the stations at which fingers can land
``orbit_landfalls``   which of these hold with a finger that is kept
``states``            ``StateChecks``: may the hand be there?  Quick answers, and exact ones
``held``              contacts of such a table, and questions to it
``stops``             what ends the motion that a contact is carried through
``landings``          where a finger can touch: sites all over the object, and whether and how a tip gets to them
``spot_pairs``        ``SpotPairs``: many pairs of contacts at once
``still``             ``StillContacts``: contacts around an object that stands still, of any place and posture
``start_pairs``       ``list_pairs``: pairs of contacts where a plan may begin if the planner may choose
``track``             ``Track``: the object's way, with stops at which fingers may be relocated
``layers``            ``Layers``: the same at every one of several poses, and how contacts are carried on
``rolling_contacts``  ``RollingContacts``: the oracle for fingers whose contacts roll
``rolling_stations``  ``RollingStations``: grips judged at stations, slip by the law
``rolling_touches``   ``RollingTouches``: contacts landed once and carried along
====================  =============================================================================================

Station, orbit, leg and hover are explained, with pictures, in ``docs/glossary.md``.

At how many stops may fingers be relocated while an object turns by a radian?

>>> import numpy as np
>>> from dexplan.planning.contacts.track import Track
>>> from dexplan.plans.motion import ObjectMotion
>>> turn = ObjectMotion(np.eye(4), np.array([0.0, 0.0, 1.0]), 1.0, np.zeros(3))
>>> len(Track((turn,)).poses)
6
"""

__all__ = [
    "candidates",
    "contact_table",
    "held",
    "landings",
    "layers",
    "legs",
    "oracle",
    "orbit_contacts",
    "orbit_landfalls",
    "orbits",
    "rolling_contacts",
    "rolling_stations",
    "rolling_touches",
    "site_contacts",
    "spot_pairs",
    "start_pairs",
    "states",
    "still",
    "stops",
    "track",
]
