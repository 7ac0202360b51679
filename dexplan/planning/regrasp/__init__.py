"""Change the contacts while the object rests or is carried: which finger moves where, in which order.

===============  =================================================================
``search``       ``AdjustmentSearch``: from one of several grasps to a goal grasp
``any_grip``     ``SiteGait``: a gait without any symmetry of the object
``goal_side``    the goal grasp seen from behind
``ends``         which grips at the end of the way are the goal
``moves``        what such a search answers with
===============  =================================================================
"""

__all__ = ["any_grip", "ends", "goal_side", "moves", "search"]
