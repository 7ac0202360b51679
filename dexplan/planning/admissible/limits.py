"""What a state must leave to spare to be planned through: numbers only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dexplan.plans.forces import NormalForces

JOINT_MARGIN_DEG, CLEARANCE_MM = 5.0, 2.0
"""Usual distance of loaded fingers' joints to their limits [deg], and of bodies that do not touch [mm]."""


@dataclass(frozen=True)
class AdmissibleLimits:
    """What a state must leave to spare to be planned through; joint margin, clearance and shares are ``[margins]`` of a problem.

    The judge's limits are its own: a plan that leaves less than they ask for is carried out, and fails.
    """

    joint_margin: float = float(np.radians(JOINT_MARGIN_DEG))
    """Distance of every joint to its limits [rad]."""
    travel_margin: float = float(np.radians(4.0))
    """The same for a free finger on its way [rad].  The judge asks 3 degrees of every finger at every sample; the rest is for
    what execution adds."""
    dexterity: float = 0.25
    """Smallest singular value of a loaded finger's Jacobian, lengths in 60 mm: away from singular postures."""
    cone_share: float = 0.98
    """Share of the believed friction cone that planned forces may use.  The pyramid inscribed in the cone keeps up to 4 % back by
    itself.  A pure squeeze between two contacts 140 degrees apart already uses 0.86 of the cone at mu 0.55 / 1.3: a share of
    0.8 would refuse grasps that hold in the simulator with a quiet utilisation of 0.72."""
    closure_margin: float = float(np.radians(1.5))
    """Angle that a pair keeps between its chord and the border of the believed friction cones [rad]."""
    torque_share: float = 0.70
    """Share of the torque limits that planned forces may use."""
    clearance: float = 1e-3 * CLEARANCE_MM
    """Distance between bodies that do not touch [m]."""
    normal_floor: float = NormalForces.floor
    normal_ceiling: float = NormalForces.ceiling
    """Least and greatest normal force of a loaded contact [N]."""
