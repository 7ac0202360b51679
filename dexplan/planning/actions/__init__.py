"""From what a search found to the actions of a plan, each with its phases, margins and reason.

================  =======================================================================
``gaits``         substitutions and rewinds
``coordinated``   the object moves, all contacts stay
``joining``       pieces that were planned apart, as one plan
``overlap``       a free finger travels while the others move the object [paper §1 (c)]
``schedule``      the last step: arcs of free fingers and all durations written in
================  =======================================================================

>>> import numpy as np
>>> from dexplan.planning.actions.gaits import build_hold
>>> from dexplan.plans.motion import rest_at
>>> hold = build_hold((None, None), rest_at(np.eye(4), np.array([0.0, 0.0, 1.0])), "nothing is to be done")
>>> hold.name, hold.why, hold.is_timed
('hold', 'nothing is to be done', False)
"""

__all__ = ["coordinated", "gaits", "joining", "overlap", "schedule"]
