"""From what a search found to the actions of a plan, each with its phases, margins and reason.

================  =======================================================================
``gaits``         substitutions and rewinds
``coordinated``   the object moves, all contacts stay
``joining``       pieces that were planned apart, as one plan
``overlap``       a free finger travels while the others move the object [paper §1 (c)]
``schedule``      the last step: arcs of free fingers and all durations written in
================  =======================================================================
"""

__all__ = ["coordinated", "gaits", "joining", "overlap", "schedule"]
