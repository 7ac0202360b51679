"""Defaults that follow from what the file says: what is left out must never be what a written key is refused for.

All functions work on the plain dict of a problem file, before its types are checked: what is no number or no table is left for
the checks, which refuse it by its own name.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from math import pi
from typing import Any

from msgspec import ValidationError, convert

from dexplan.problems.object_section import ObjectSection, ShapeSection
from dexplan.problems.rules import BOUNDS
from dexplan.problems.sections import ForcesSection, FrictionSection, HandSection
from dexplan.problems.shapes import build_shape

PATCH_PER_TIP = 0.3
"""``torsional_m`` may be at most this times sliding times tip radius: a patch about half as wide as the tip [Hertz]."""
LONGEST_NAME = 100

FORCES = ("normal_floor_N", "normal_ceiling_N", "normal_N")
"""Keys of ``[forces]``, those first that follow from others."""
ALTERNATIVES = ("rotation", "orientation_wxyz")
"""Keys of ``[goal]`` of which a problem may have one."""


def compute_largest_torsion(sliding: float, tip_radius: float, curvature: float = 0.0) -> float:
    """Return the largest torsional friction [m] that a tip of this radius [m] can have at this sliding friction.

    On a face, and on a ball, whose curvature is left out, the patch is about half as wide as the tip.  On a body of the mean
    ``curvature`` 1 / R [1/m] it is no wider than r R / (r + R), the radius of the sphere that touches a plane as these two touch
    each other [Hertz]; its torsion is then mu_t = 3 pi / 16 mu a.
    """
    widest = 1.0 / (1.0 / tip_radius + curvature)
    return sliding * min(PATCH_PER_TIP * tip_radius, 3.0 * pi / 16.0 * widest)


def as_name(text: str) -> str:
    """Return ``text`` as a problem's name, which is also a folder's: accents are dropped, other signs become ``_``."""
    plain = unicodedata.normalize("NFKD", text.replace("ß", "ss"))
    plain = "".join(sign for sign in plain if not unicodedata.combining(sign))
    name = re.sub(r"[^A-Za-z0-9_.-]+", "_", plain).lstrip("_.-")[:LONGEST_NAME].rstrip("_.-")
    return name or "problem"


def fill_derived(data: dict[str, Any]) -> None:
    """Write into ``data`` the defaults that depend on other keys, where it leaves them out."""
    friction = data.get("friction", {})
    if isinstance(friction, dict) and "torsional_m" not in friction:
        torsional = _derive_torsion(data)
        if torsional is not None:
            data["friction"] = {**friction, "torsional_m": torsional}
    forces = data.get("forces")
    if isinstance(forces, dict):
        data["forces"] = {**_derive_forces(forces), **forces}
    goal = data.get("goal")
    if isinstance(goal, dict) and "kind" not in goal:
        data["goal"] = {**goal, "kind": _derive_kind(goal)}


def forget_derived(data: dict[str, Any]) -> None:
    """Take torsional friction and normal forces out of ``data`` where :func:`fill_derived` would write the same, so that they
    follow what is replaced next.

    A run folder's copy has all defaults written out, and has to take the same ``--set`` as the file that it came from.
    """
    friction = data.get("friction")
    if isinstance(friction, dict) and "torsional_m" in friction:
        rest = {key: value for key, value in friction.items() if key != "torsional_m"}
        if friction["torsional_m"] == _derive_torsion({**data, "friction": rest}):
            data["friction"] = rest
    forces = data.get("forces")
    if isinstance(forces, dict):
        for key in FORCES:
            rest = {name: value for name, value in forces.items() if name != key}
            if key in forces and forces[key] == _derive_forces(rest).get(key):
                forces = rest
        data["forces"] = forces


def _derive_torsion(data: Mapping[str, Any]) -> float | None:
    """Return the default torsional friction [m]: the usual one, or what the smallest tip can have if that is less."""
    friction, hand = data.get("friction", {}), data.get("hand", {})
    if not (isinstance(friction, dict) and isinstance(hand, dict)):
        return None
    sliding = friction.get("sliding", FrictionSection.sliding)
    tips = hand.get("tip_radii_m", HandSection.tip_radii_m)
    if not isinstance(tips, list | tuple) or not all(_is_positive(x) for x in (sliding, *tips)) or not tips:
        return None
    curvature = _find_curvature(data.get("object"))
    return min(FrictionSection.torsional_m, compute_largest_torsion(sliding, min(tips), curvature))


def _find_curvature(thing: object) -> float:
    """Return the greatest mean curvature [1/m] of the object; 0 where what is written is no shape, and for a ball."""
    shape = thing.get("shape") if isinstance(thing, dict) else None
    try:
        return (
            0.0 if shape is None else build_shape(ObjectSection(shape=convert(shape, ShapeSection))).curvature
        )
    except (ValidationError, ValueError):
        return 0.0


def _derive_forces(forces: Mapping[str, Any]) -> dict[str, float]:
    """Return the normal forces [N] that ``forces`` leaves out: the usual ones, moved as far as what is written asks for."""
    usual = ForcesSection()
    floor, ceiling = forces.get("normal_floor_N"), forces.get("normal_ceiling_N")
    target = forces.get("normal_N", usual.normal_N)
    if not all(
        _is_positive(x) and BOUNDS[f"forces.{key}"].accepts(x) for key, x in forces.items() if key in FORCES
    ):
        return {}
    if "normal_N" not in forces:
        target = max(target, floor or target)
        target = min(target, ceiling or target)
    share = usual.normal_floor_N / usual.normal_N
    derived = {
        "normal_N": target,
        "normal_floor_N": min(usual.normal_floor_N, share * target),
        "normal_ceiling_N": max(usual.normal_ceiling_N, target),
    }
    return {key: value for key, value in derived.items() if key not in forces}


def _is_positive(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value < 1e6


def _derive_kind(goal: Mapping[str, Any]) -> str:
    if "contacts_deg" not in goal:
        return "object_manipulation"
    shift = goal.get("translation_m")
    moves = any(key in goal for key in ALTERNATIVES) or (isinstance(shift, list | tuple) and any(shift))
    return "dextrous_manipulation" if moves else "grasp_adjustment"
