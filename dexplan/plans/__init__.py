"""What a plan is: values that planning writes and everybody else reads; nothing is decided here.

============  ===========================================================================
``plan``      ``Plan``: status, contacts, actions; ``plan.json`` written and read
``actions``   ``Hold``, ``Roll``, ``MoveObject``, ``Relocate``, each with its motion and ways
``contacts``  where fingers touch: placements, and goal contacts
``phases``    stretches of an action: who has to touch, may, or must not
``timing``    ``Timing``: speeds and pauses that durations are made from
``status``    ``Status``: solved, or which kind of no, each with what it means
``refusal``   ``Refusal``: what stood in the way, with numbers and what would help
``goal``      ``RotationGoal``: a turn and shift of the object, or an attitude
``motion``    ``ObjectMotion``: a turn about an axis with a straight shift, and poses on it
``tip_roll``  the path of a tip that rolls while it holds
``forces``    ``NormalForces``: how hard a contact presses, with the usual values
``margins``   what an action leaves to spare, in words beside its limits
``speed``     how fast the object turns, and what keeps it from turning faster
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
    "margins",
    "motion",
    "pace",
    "phases",
    "plan",
    "poses",
    "refusal",
    "speed",
    "status",
    "timing",
    "tip_roll",
]
