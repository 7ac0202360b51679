"""A tip that keeps touching while it moves: rolled starts, rolled ends, and objects carried on rolling tips.

==================  ================================================================================
``roll_gait``       ``RollToPair``: three fingers roll until two of them hold alone [paper §1, §3]
``rolls``           ``build_roll``: the roll of one finger, on a ball or another smooth body
``roll_to_goal``    fingers that touch already roll to their goal contacts
``rolling_carry``   ``plan_rolling_turn``: the object turns while the tips roll on it
==================  ================================================================================

The geometry behind these is in :mod:`dexplan.contact.rolling`; here the finger's joints, clearance and forces are added.

A tip of 18 mm rolls 5 mm, that is 8.2 degrees, over a ball of 35 mm; in the object frame it turns by more:

>>> import numpy as np
>>> import dexplan as dx
>>> from dexplan.pipeline import build_hand, build_scene
>>> from dexplan.planning.rolling.rolls import build_roll
>>> problem = dx.load_problem("hold_two")
>>> hand = build_hand(problem, build_scene(problem))
>>> placement = dx.plan(problem).start_contacts[0]
>>> roll = build_roll(hand, placement, np.array([0.0, 0.0, 1.0]), np.radians(8.2), count=5)
>>> len(roll.X_OF), bool(roll.normal_O[-1] @ [0.0, 0.0, 1.0] > 0.1)
(5, True)
"""

__all__ = ["roll_gait", "roll_to_goal", "rolling_carry", "rolls"]
