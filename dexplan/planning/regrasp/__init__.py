"""Change the contacts while the object rests or is carried: which finger moves where, in which order.

================  ================================================================
``search``        ``AdjustmentSearch``: from one of several grasps to a goal grasp
``any_grip``      ``SiteGait``: a gait without any symmetry of the object
``goal_side``     the goal grasp seen from behind
``ends``          which grips at the end of the way are the goal
``moves``         what such a search answers with
``rolling_gait``  ``RollingGait``: a gait on contacts that roll
================  ================================================================

What such a search answers with is a list of moves; grasps are the same where fingers touch at the same places:

>>> import dexplan as dx
>>> from dexplan.planning.regrasp.moves import is_same
>>> start = dx.plan(dx.load_problem("hold_two")).start_contacts
>>> is_same(start, start), is_same(start, (None, *start[1:]))
(True, False)
"""

__all__ = ["any_grip", "ends", "goal_side", "moves", "rolling_gait", "search"]
