"""What the summary draws over time: forces, friction used, errors and the turn, from a trace's columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.brief import brief_repr
from dexplan.plans.plan import Plan
from dexplan.sim.trace import Trace
from dexplan.spatial import Array
from dexplan.viz.timeline import choose_axis, compute_turned_angle

LEAST_FORCE = 0.05
"""Below this normal force [N] a ratio to it says nothing."""


@dataclass(frozen=True, eq=False)
class Curves:
    """What is drawn over time (T,): forces [N] and utilisation (T, F), errors [mm], [deg], turns [deg]."""

    time: Array
    normal_force: Array
    normal_force_reference: Array
    utilisation: Array
    position_error_mm: Array
    rotation_error_deg: Array
    turned_deg: Array
    turned_reference_deg: Array

    __repr__ = brief_repr


def compute_curves(problem: Mapping[str, Any] | None, plan: Plan, trace: Trace) -> Curves:
    """Return the curves of a run; missing numbers stay NaN and leave gaps."""
    model = mujoco.MjModel.from_xml_string(trace.model_xml)
    address = int(model.joint("object/free/").qposadr[0])
    pose, reference = trace["qpos"][:, address : address + 7], trace["object_pose_reference"]
    # A run that diverged ends in samples that are no numbers; curves stop before them.
    is_good = np.isfinite(pose).all(axis=1) & np.isfinite(reference).all(axis=1)
    sliding, torsional = _read_friction(problem, model)
    axis = choose_axis(plan)
    rotation_error, turned, turned_reference = (np.full(len(pose), np.nan) for _ in range(3))
    if is_good.any():
        actual = Rotation.from_quat(pose[is_good, 3:], scalar_first=True)
        wanted = Rotation.from_quat(reference[is_good, 3:], scalar_first=True)
        rotation_error[is_good] = np.degrees((wanted.inv() * actual).magnitude())
        turned[is_good] = np.degrees(compute_turned_angle(pose[is_good], axis))
        turned_reference[is_good] = np.degrees(compute_turned_angle(reference[is_good], axis))
    force = trace["contact_force"]
    # Runs of other controllers plan no forces.
    planned = trace.columns.get("contact_force_reference", np.full(force.shape, np.nan))
    return Curves(
        time=trace["time"],
        normal_force=force[..., 2],
        normal_force_reference=planned[..., 2],
        utilisation=compute_utilisation(force, sliding, torsional),
        position_error_mm=1e3 * np.linalg.norm(pose[:, :3] - reference[:, :3], axis=1),
        rotation_error_deg=rotation_error,
        turned_deg=turned,
        turned_reference_deg=turned_reference,
    )


def compute_utilisation(force: Array, sliding: float, torsional: float) -> Array:
    """Return the share (...) of the soft-finger friction cone that contact forces (..., 4) use; 1 slides.

    ``sqrt(|f_t|^2 / mu^2 + tau^2 / mu_t^2) / f_n``; NaN where there is next to no normal force.
    """
    tangential = np.hypot(force[..., 0], force[..., 1]) / sliding
    normal = np.where(force[..., 2] > LEAST_FORCE, force[..., 2], np.nan)
    used: Array = np.hypot(tangential, force[..., 3] / torsional) / normal
    return used


def _read_friction(problem: Mapping[str, Any] | None, model: Any) -> tuple[float, float]:
    """Return sliding [-] and torsional [m] friction between tip and object."""
    if problem is not None:
        return float(problem["friction"]["sliding"]), float(problem["friction"]["torsional_m"])
    tips = [k for k in range(model.ngeom) if model.geom(k).name.endswith("/tip")]
    # MuJoCo takes the larger friction of the two geoms.
    pair = model.geom_friction[[*tips[:1], model.geom("object/surface").id]].max(axis=0)
    return float(pair[0]), float(pair[1])
