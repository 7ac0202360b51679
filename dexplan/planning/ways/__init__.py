"""How does a free finger get there?  An arc around the object, or a detour around what is in the arc's way.

=======================  ================================================================
``travel``               ``find_way``: the arc where it is free, else a detour, else None
``detour``               ``find_detour``: bowed arcs, then OMPL's RRT-Connect
``configuration_space``  ``classify``: free, contact or collision [paper §2]
=======================  ================================================================

A way is a table (K, J) of postures [rad], which a plan keeps and a controller follows.

The hand at home, beside the ball, touches nothing; with 2 mm between bodies a finger may travel:

>>> import dexplan as dx
>>> from dexplan.pipeline import build_hand, build_scene
>>> from dexplan.planning.ways.configuration_space import classify
>>> problem = dx.load_problem("hold_two")
>>> hand = build_hand(problem, build_scene(problem))
>>> found = classify(hand, hand.q_home)
>>> found.kind, found.clearance > 0.002
('free', True)
"""

__all__ = ["configuration_space", "detour", "travel"]
