"""What a plan is: values that planning writes and everybody else reads; nothing is decided here.

============  ===========================================================================
>>> import numpy as np
>>> from dexplan.plans.motion import ObjectMotion
>>> quarter = ObjectMotion(np.eye(4), np.array([0.0, 0.0, 1.0]), np.pi / 2, np.array([0.01, 0.0, 0.0]))
>>> quarter.X_WO_end[:3].round(3).tolist()
[[0.0, -1.0, 0.0, 0.01], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
"""

__all__ = [
    "actions",
    "contacts",
    "forces",
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
