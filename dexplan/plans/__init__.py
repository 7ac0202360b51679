"""What a plan is: values that planning writes and everybody else reads; nothing is decided here.

==========  ==================================================================================
``plan``    ``Plan``, its actions and placements; ``plan.json`` written and read
``goal``    ``RotationGoal``: a turn and shift of the object, or an attitude
``motion``  ``ObjectMotion``: a turn about an axis with a straight shift, and poses on its way
``roll``    the path of a tip that rolls while it holds
``forces``  ``NormalForces``: how hard a contact presses, with the usual values
``speed``   how fast the object turns, and what keeps it from turning faster
==========  ==================================================================================

>>> import numpy as np
>>> from dexplan.plans.motion import ObjectMotion
>>> quarter = ObjectMotion(np.eye(4), np.array([0.0, 0.0, 1.0]), np.pi / 2, np.array([0.01, 0.0, 0.0]))
>>> quarter.X_WO_end[:3].round(3).tolist()
[[0.0, -1.0, 0.0, 0.01], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
"""

__all__ = ["forces", "goal", "motion", "plan", "roll", "speed"]
