"""Change the contacts while the object rests or is carried: which finger moves where, in which order.

===============  =================================================================
``search``       ``AdjustmentSearch``: from one of several grasps to a goal grasp
``goal_side``    the goal grasp seen from behind
``moves``        what such a search answers with
===============  =================================================================
"""

__all__ = ["goal_side", "moves", "search"]
