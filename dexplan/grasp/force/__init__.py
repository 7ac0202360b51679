"""Which contact forces?  A quadratic program per instant, solved by DAQP or OSQP, proven, and explained where it has no answer.

===============  =====================================================================================
``solver``       ``ForceSolver``: built once per contact mode, asked once per tick
``problem``      ``ForceLimits``, ``ForceSettings``, ``ForceProblem``: what is asked
``solution``     ``ForceSolution``: forces with the problem they answer, residuals and proof
``certificate``  ``prove_optimality``: how far an answer is from the best one at most
``pivoting``     ``PivotingSolver``: forces where contacts turn about their normals, torsion saturated
``diagnosis``    by how much which limit would have to give way where no forces exist
===============  =====================================================================================

Two soft fingers on opposite sides of a 60 g ball carry its weight and squeeze with about 5 N:

>>> import numpy as np
>>> from dexplan.contact.friction import SoftFinger
>>> from dexplan.grasp.force.problem import ForceLimits, ForceProblem, ForceSettings
>>> from dexplan.grasp.force.solver import ForceSolver
>>> from dexplan.grasp.grasp import Grasp, compute_grasp_map, contact_on_sphere
>>> model = SoftFinger(0.55, 0.0025)
>>> grasp = Grasp(tuple(contact_on_sphere(i, [x, 0.0, 0.0], 0.035, model) for i, x in enumerate((1.0, -1.0))))
>>> limits = ForceLimits(np.full(2, 4.0), np.full(2, 12.0))
>>> weight = np.array([0.0, 0.0, 0.060 * 9.81, 0.0, 0.0, 0.0])
>>> settings = ForceSettings(tuple(grasp.models))
>>> problem = ForceProblem(settings, compute_grasp_map(grasp), weight, limits, np.full(2, 5.0))
>>> found = ForceSolver(settings).solve(problem)
>>> found.status, found.forces[:, 2].round(2).tolist()
('solved', [5.0, 5.0])
"""

from dexplan.moved import forward

__all__ = ["certificate", "diagnosis", "pivoting", "problem", "program", "solution", "solver"]

__getattr__ = forward(__name__, ["dexplan.grasp.force.solver", "dexplan.grasp.force.problem"])
