"""How to do it: a plan becomes curves in time, and each tick what is sensed becomes what the servos are told.

===============  =====================================================================================
``reference``    ``build_reference``: the plan's phases as curves in time
``controller``   ``Controller.step``: an ``Observation`` in, a ``Command`` out
``observation``  ``Observation``: all that the controller may know, as a real robot would
``options``      ``ControlOptions``: what the controller believes and how it is tuned
``rate``         how often it has to be asked
``speed``        how fast the object turns, and what keeps it from turning faster
===============  =====================================================================================

The quintic along which everything moves starts and ends at rest:

>>> from dexplan.control.reference import smooth_step
>>> [float(smooth_step(s)) for s in (0.0, 0.5, 1.0)]
[0.0, 0.5, 1.0]
"""

__all__ = ["controller", "observation", "options", "rate", "reference", "speed"]
