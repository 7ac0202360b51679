"""Checks in groups, so that a run of somebody else's controller is judged by what it has: no QP of ours, no plan of forces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

from dexplan.errors import ProblemError, UnknownNameError

GROUPS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "physics": (
            "replay_matches",
            "trace_consistent",
            "physics_untouched",
            "files_agree",
            "object_support_other",
            "unexpected_contacts",
            "joint_limit_margin_min",
            "torque_utilisation_max",
        ),
        "task": (
            "phases_in_order",
            "reference_position_error_max",
            "reference_rotation_error_max",
            "reference_speed_max",
            "not_dropped",
            "position_error_max",
            "rotation_error_max",
            "position_error_final",
            "rotation_error_final",
            "turned_angle",
            "contact_error_final",
        ),
        "contacts": (
            "contact_schedule",
            "contact_region_error_max",
            "edge_distance_min",
            "finger_order_kept",
            "friction_utilisation_max",
            "coulomb_slip_max",
            "creep_rate_max",
            "rolling_error_max",
            "roll_path_error_max",
            "penetration_max",
            "tip_contact_angle_max",
            "tip_rotation_max",
            "free_finger_clearance_min",
        ),
        "forces": ("plan_force_closure", "plan_load_margin", "force_qp_feasible"),
        "internals": (
            "force_cone_margin_min",
            "force_prediction_error",
            "tip_tracking_error_max",
            "ik_at_limit",
        ),
    }
)
"""Group -> its checks.  *Physics*: is it an honest simulation?  *Task*: was done what was asked for?  *Contacts*: do they hold?
*Forces*: could they?  *Internals*: did our controller do what it meant to?"""


OWN_GROUPS = frozenset({"internals"})
"""Groups about what dexplan's own controller says of itself.  Runs of other controllers have no record to judge there."""
OWN_COLUMNS = (
    "contact_force_reference",
    "qp_status",
    "qp_wrench_residual",
    "tip_tracking_error",
    "ik_at_limit",
)
"""Columns that dexplan's own controller writes, and nobody else."""


def read_controller(meta: Mapping[str, Any]) -> str | None:
    """Return the controller that a record's meta says it was made with, None for dexplan's own.

    The record's own word decides, not what columns it has: a run of dexplan's own that lacks some of them has lost them.
    """
    named = meta.get("controller")
    return " ".join(named.split()) or None if isinstance(named, str) else None


def choose_judged(asked: tuple[str, ...], controller: str | None) -> tuple[str, ...]:
    """Return those groups ``asked`` for that can be judged of a run by ``controller``; ProblemError where none is left."""
    judged = tuple(name for name in asked if controller is None or name not in OWN_GROUPS)
    if not judged:
        fact = f"nothing is recorded of {', '.join(asked)} in a run by {controller}"
        rest = ", ".join(name for name in GROUPS if name not in OWN_GROUPS)
        raise ProblemError("groups", "", fact, f"accepted: {rest}")
    return judged


def resolve_groups(groups: Iterable[str] | None) -> tuple[str, ...]:
    """Return the groups to judge, in the order of :data:`GROUPS`; None stands for all of them.

    Raises UnknownNameError for a name that is no group, ProblemError where none is left.
    """
    if groups is None:
        return tuple(GROUPS)
    asked = {groups} if isinstance(groups, str) else set(groups)
    for name in sorted(asked - set(GROUPS)):
        raise UnknownNameError("group of checks", name, GROUPS)
    if not asked:
        raise ProblemError("groups", "", "no group of checks is named", f"accepted: {', '.join(GROUPS)}")
    return tuple(name for name in GROUPS if name in asked)


def find_group(check: str) -> str:
    """Return the group of a check."""
    return next(group for group, names in GROUPS.items() if check in names)
