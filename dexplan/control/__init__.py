"""How to do it: a plan becomes curves in time, and each tick what is sensed becomes what the servos are told.

======================  ===============================================================================
``reference``           ``build_reference``: the plan's phases as curves in time
``controller``          ``Controller.step``: an ``Observation`` in, a ``Command`` out
``observation``         ``Observation``: all that the controller may know, as a real robot would
``foreign``             what other controllers are told and answer: ``RunStart``, ``ForeignController``
``options``             ``ControlOptions``: what the controller believes and how it is tuned
``rate``                how often it has to be asked
``rolling_controller``  ``RollingController``: a simple controller for contacts that roll
``rolling_phases``      ``build_stretches``: its plan in time
======================  ===============================================================================

A plan has all ways and times; the reference has nothing to compute but curves through them:

>>> import numpy as np
>>> from dexplan.control.reference import ObjectPath
>>> from dexplan.plans.motion import ObjectMotion
>>> from dexplan.plans.pace import Pace
>>> shift = ObjectMotion(np.eye(4), np.array([0.0, 0.0, 1.0]), 0.0, np.array([0.0, 0.0, 0.02]))
>>> path = ObjectPath(shift, Pace(duration=1.0, ramp=0.3, limit="shift_speed"))
>>> [round(float(path.sample(t).X_WO[2, 3]), 9) for t in (0.0, 0.5, 1.0)]
[0.0, 0.01, 0.02]
"""

__all__ = [
    "controller",
    "foreign",
    "named",
    "observation",
    "options",
    "rate",
    "reference",
    "rolling_controller",
    "rolling_phases",
]
