"""One best-first engine over grips and progress: what to open next, what was refused, and when it is enough.

==============  ====================================================================================
``nodes``       a grip at some progress, what the way there counts, and the moves that led there
``moves``       ``Go``, ``Place``, ``Lift``, ``RollTo``
``problem``     what poses a problem to the engine: what nodes are worth, are refused for, lead to
``cost``        what makes a plan better than another one
``options``     what users set
``stepwise``    ``StepProblem``: one move at a time, over any contacts, on to a grip that counts as an end
``engine``      ``Engine``: opens nodes, the most promising first, judges them when their turn comes
==============  ====================================================================================

Nothing here knows how many fingers there are, how many joints they have, or what shape the object has.
"""

from dexplan.moved import forward

__all__ = ["cost", "engine", "moves", "nodes", "options", "problem", "stepwise"]

__getattr__ = forward(__name__, ["dexplan.planning.gait.search"])
