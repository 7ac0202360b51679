"""What a plan is: values that planning writes and everybody else reads; nothing is decided here.

============  ==================================================================================
``plan``      ``Plan``: ``plan.json`` written and read, and the plan in words
``actions``   ``Hold``, ``Roll``, ``MoveObject``, ``Relocate``: what a plan is made of
``contacts``  ``Placement``: where and how a finger touches; ``GoalContact``
``phases``    stretches of an action, with demands on every finger
``motion``    ``ObjectMotion``: a turn about an axis with a straight shift, and poses on its way
``tip_roll``  ``TipRoll``: the path of a tip that rolls while it holds
``pace``      ``Pace``: how a motion goes in time
``timing``    ``Timing``: how long things take, and how fast they may go
``speed``     how fast the object turns, and what keeps it from turning faster
``goal``      ``RotationGoal``: a turn and shift of the object, or an attitude
``poses``     poses as they stand in ``plan.json``: seven numbers, rounded
============  ==================================================================================

>>> import numpy as np
>>> from dexplan.plans.motion import ObjectMotion
>>> quarter = ObjectMotion(np.eye(4), np.array([0.0, 0.0, 1.0]), np.pi / 2, np.array([0.01, 0.0, 0.0]))
>>> quarter.X_WO_end[:3].round(3).tolist()
[[0.0, -1.0, 0.0, 0.01], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
"""

__all__ = [
    "actions",
    "contacts",
    "goal",
    "motion",
    "pace",
    "phases",
    "plan",
    "poses",
    "speed",
    "timing",
    "tip_roll",
]
