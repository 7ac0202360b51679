"""Statics of a held object: can these contacts hold it, how safely, and with which forces?

================  =================================================================================
``grasp``         ``Contact``, ``Grasp``: values; ``contact_on_sphere``, ``compute_grasp_map``: wrench = G f
``closure``       ``check_force_closure``, ``compute_load_margin``, ``check_antipodal``: answers with margins
``pairs``         ``measure_chord_lean``: which of many pairs hold alone, on any body
``wrench``        ``compute_wrench``: what the contacts have to exert, held or moved
``quality``       ``compute_quality``: all quality terms of a grasp as one value
``margin``        the programs behind the margins: exact cones by an interior point, pyramids by an LP
``closed_forms``  the paper's formulas for pairs and triples, as theory and as a second opinion
``force``         ``ForceSolver``: the contact forces of one instant, with a proof that they are best
================  =================================================================================

Two soft fingers hold a ball if they are far enough apart: with friction 0.55 from 180 - 2 atan(0.55) = 122.4 degrees on.
``ClosureResult`` says how much is left, in which unit, and whether a "no" settles the question.

>>> import numpy as np
>>> from dexplan.contact.friction import SoftFinger
>>> from dexplan.grasp.closure import check_force_closure
>>> from dexplan.grasp.grasp import Grasp, contact_on_sphere
>>> def hold(apart_deg):
...     azimuths = np.radians([0.0, apart_deg])
...     model = SoftFinger(0.55, 0.0025)
...     return Grasp(tuple(
...         contact_on_sphere(i, [np.cos(a), np.sin(a), 0.0], 0.035, model) for i, a in enumerate(azimuths)
...     ))
>>> [check_force_closure(hold(angle)).is_closed for angle in (120.0, 140.0)]
[False, True]
"""

__all__ = ["closed_forms", "closure", "force", "grasp", "margin", "pairs", "quality", "wrench"]
