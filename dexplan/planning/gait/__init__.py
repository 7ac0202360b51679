"""Turn and shift the object by exchanging the fingers that hold it: finger substitution and finger rewind.

===============  ==============================================================================
``routes``       the ways that an object may take to its goal, as legs
``exchange``     can fingers be exchanged?
``search``       ``GaitSearch``: which finger lifts, where it lands, how far the object goes
``escape``       where a pair takes the object first, if no other finger finds room beside it
``theorem_1``    the paper's necessary condition for a gait
``steps``        what a search answers with
===============  ==============================================================================

Station, orbit, leg and hover are explained, with pictures, in ``docs/glossary.md``.

To an attitude there are many ways, each of them legs: turns about one axis each.

>>> import numpy as np
>>> from dexplan.planning.gait.routes import build_routes
>>> from dexplan.plans.goal import RotationGoal
>>> from dexplan.spatial import rotate_about
>>> goal = RotationGoal.from_attitude(np.eye(4), rotate_about([1.0, 0.0, 0.0], 0.7), np.zeros(3))
>>> routes = build_routes(goal)
>>> len(routes[0]), round(float(np.degrees(routes[0][0].angle)), 1)
(1, 40.1)
"""

__all__ = ["escape", "exchange", "routes", "search", "start_pairs", "steps", "theorem_1"]
