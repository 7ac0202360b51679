"""How does a free finger get there?  An arc around the object, or a detour around what is in the arc's way.

=======================  ================================================================
``travel``               ``find_way``: the arc where it is free, else a detour, else None
``detour``               ``find_detour``: bowed arcs, then OMPL's RRT-Connect
``configuration_space``  ``classify``: free, contact or collision [paper §2]
=======================  ================================================================

A way is a table (K, J) of postures [rad], which a plan keeps and a controller follows.
"""

__all__ = ["configuration_space", "detour", "travel"]
