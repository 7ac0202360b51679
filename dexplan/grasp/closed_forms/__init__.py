"""Formulas instead of programs: the paper's pairs and triples, kept as theory and as a second opinion.

=============  =====================================================================================
``pair``       ``sphere_pair_angle_min``, ``check_sphere_pair``: two soft fingers on a ball; preload of a pair
``triple``     ``compute_triple_margin``, ``check_hard_triple``: three hard fingers on any surface, exact
``agreement``  do formulas and the general test agree on random grasps?  (``scripts/closure_sweep``)
=============  =====================================================================================

>>> import numpy as np
>>> from dexplan.grasp.closed_forms.pair import sphere_pair_angle_min
>>> round(float(np.degrees(sphere_pair_angle_min(0.55))), 1)
122.4
"""

__all__ = ["agreement", "pair", "triple"]
