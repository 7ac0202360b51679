"""A tip that keeps touching while it moves: rolled starts, rolled ends, and objects carried on rolling tips.

==================  ================================================================================
``roll_gait``       ``RollToPair``: three fingers roll until two of them hold alone [paper §1, §3]
``roll_to_goal``    fingers that touch already roll to their goal contacts
``rolling_carry``   ``plan_rolling_turn``: the object turns while the tips roll on it
==================  ================================================================================

The geometry behind these is in :mod:`dexplan.contact.rolling`; here the finger's joints, clearance and forces are added.
"""

__all__ = ["roll_gait", "roll_to_goal", "rolling_carry"]
