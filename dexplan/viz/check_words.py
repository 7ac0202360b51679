"""What each check of the judge is called in words, and what it means: for figures and pages that people read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from dexplan.sim.judge.validate import ValidationReport

PASSED, FAILED = "pass", "fail"
"""Statuses that say something about a limit; any other (not applicable, not recorded) says that nothing was measured."""


@dataclass(frozen=True)
class CheckWords:
    """A check for readers: its ``title``, a few words, and its ``meaning``, one or two sentences."""

    title: str
    meaning: str


GROUP_QUESTIONS: Mapping[str, str] = MappingProxyType(
    {
        "physics": "Is it an honest simulation?",
        "task": "Was done what was asked for?",
        "contacts": "Do the contacts hold?",
        "forces": "Could the contacts carry the object at all?",
        "internals": "Did the controller do what it meant to?",
    }
)
"""What each group of checks asks."""

_WORDS: dict[str, tuple[str, str]] = {
    # physics
    "replay_matches": (
        "replay equals record",
        "The judge steps MuJoCo again with the recorded controls. Every joint position has to come out the same to the last bit.",
    ),
    "trace_consistent": (
        "recorded contacts are true",
        "Samples whose recorded contacts or forces differ from those of the replay.",
    ),
    "physics_untouched": (
        "physics untouched",
        "Departures of the simulated model from what is allowed: gravity, friction and solver settings as stated, no hidden "
        "welds, no forces from outside.",
    ),
    "files_agree": ("files agree", "Contradictions between problem, plan, model and record of this run."),
    "object_support_other": (
        "nothing else holds the object",
        "Force on the object from anything but fingertips: links, floor, obstacles.",
    ),
    "unexpected_contacts": (
        "unexpected contacts",
        "Touches that should not be: link on object, finger on finger, anything on the floor or on an obstacle.",
    ),
    "joint_limit_margin_min": (
        "room to joint stops",
        "The smallest angle between any joint and its nearer stop.",
    ),
    "torque_utilisation_max": (
        "servo torque used",
        "The largest share of its torque limit that any servo used.",
    ),
    # task
    "phases_in_order": (
        "plan followed in order",
        "The run passes through every phase of the plan once, in order; counted are departures.",
    ),
    "reference_position_error_max": (
        "asked for the planned places",
        "The path that the controller was given, against the positions in the plan.",
    ),
    "reference_rotation_error_max": (
        "asked for the planned attitudes",
        "The path that the controller was given, against the attitudes in the plan.",
    ),
    "reference_speed_max": ("speed asked for", "The fastest turn of the path that the controller was given."),
    "not_dropped": ("not dropped", "How far the object's centre fell under where it should be."),
    "position_error_max": (
        "position error on the way",
        "The largest distance of the object from where it should be, over the whole run.",
    ),
    "rotation_error_max": (
        "rotation error on the way",
        "The largest angle of the object from the attitude it should have, over the whole run.",
    ),
    "position_error_final": ("position error at the end", "How far from the goal the object came to rest."),
    "rotation_error_final": (
        "rotation error at the end",
        "How far turned from the goal the object came to rest.",
    ),
    "turned_angle": (
        "turn missed by",
        "How far the whole turn, counted through every revolution, is off the angle that was asked for.",
    ),
    "contact_error_final": (
        "contacts off their goals",
        "How far on the object any finger's last contact is from the contact that the goal asks for; on a ball an angle.",
    ),
    # contacts
    "contact_schedule": (
        "fingers touch as planned",
        "Samples in which a finger that must hold does not touch, or a finger that must be free does.",
    ),
    "contact_region_error_max": (
        "contacts outside allowed regions",
        "How far any contact lies outside the parts of the object that may be touched.",
    ),
    "edge_distance_min": (
        "contacts from sharp edges",
        "How near any contact comes to a sharp edge of the object, where it would soon leave its face.",
    ),
    "finger_order_kept": (
        "finger order kept",
        "Samples in which the fingers' order around the object differs from that of their bases.",
    ),
    "friction_utilisation_max": (
        "friction used",
        "The largest share of the friction cone that any contact used while contacts did not change; at 1 it slides.",
    ),
    "coulomb_slip_max": (
        "slip",
        "How far any contact slid at its friction limit, from touch to lift.",
    ),
    "creep_rate_max": (
        "creep",
        "How fast contacts drift although friction holds, as simulated contacts do; averaged over half a second.",
    ),
    "rolling_error_max": (
        "rolls without sliding",
        "Where contacts are on object and tip, against where rolling without sliding would have brought them.",
    ),
    "roll_path_error_max": ("rolled as planned", "Where rolling tips went, against the way in the plan."),
    "penetration_max": (
        "depth of contacts",
        "How deep any tip is pressed into the object by the soft contact model.",
    ),
    "tip_contact_angle_max": (
        "contact on the tip's front",
        "The largest angle between a tip's pole and its contact; behind its limit a real tip has no skin.",
    ),
    "tip_rotation_max": (
        "tip rolled round",
        "How far any contact went round on its tip: the paper's limit gamma.",
    ),
    "free_finger_clearance_min": (
        "room around free fingers",
        "The smallest gap between a free finger and the object, other fingers, obstacles and floor.",
    ),
    # forces
    "plan_force_closure": (
        "planned grasps are force closed",
        "How much smaller the friction angle could be before a planned grasp could no longer resist every small push.",
    ),
    "plan_load_margin": (
        "planned grasps carry the weight",
        "The smallest part of the believed friction cone left over when a planned grasp carries the object.",
    ),
    "force_qp_feasible": (
        "forces exist",
        "Instants at which no contact forces within friction and torque limits could give the object the motion it should "
        "have, as an independent solver finds.",
    ),
    # internals
    "force_cone_margin_min": (
        "planned forces inside friction",
        "How far inside the believed friction cone the planned forces stay, as a part of the normal force.",
    ),
    "force_prediction_error": (
        "forces as planned",
        "The difference between measured and planned normal forces while contacts do not change.",
    ),
    "tip_tracking_error_max": (
        "fingertips follow",
        "How far the joint angles that were asked for leave a fingertip from where it should be.",
    ),
    "ik_at_limit": (
        "joint commands in range",
        "Ticks in which the joint angles that were asked for ran into a limit.",
    ),
}


def describe_check(name: str) -> CheckWords:
    """Return the words for a check; a check that is not known here is called by its own name, without underscores."""
    return CheckWords(*_WORDS.get(name, (name.replace("_", " "), "")))


def list_described() -> tuple[str, ...]:
    """Return the checks that have words."""
    return tuple(_WORDS)


def spell(value: float | None, unit: str = "") -> str:
    """Return a number with two digits and its unit, for readers: ``0.037 mm``, ``360°``, ``less than 0.001 mm``."""
    if value is None:
        return "no value"
    size = abs(value)
    if value != value or size == float("inf"):
        number = str(value)
    elif size == 0.0:
        number = "0"
    elif size < 0.001:
        number = "less than 0.001" if value > 0 else "more than -0.001"
    elif size >= 9.95 or value == round(value):
        number = f"{value:.0f}"
    else:
        number = f"{value:#.2g}"
    return number + _spell_unit(unit)


def spell_beside(value: float | None, limit: float | None, unit: str = "") -> str:
    """Return a number with two digits, or with as many as it takes to see on which side of its limit the number is."""
    text = spell(value, unit)
    if value is None or limit is None or not math.isfinite(value) or abs(value) < 0.001:
        return text
    told = float(text.removesuffix(_spell_unit(unit)))
    if (told > limit) == (value > limit) and (told < limit) == (value < limit):
        return text
    digits = next((n for n in range(3, 17) if f"{value:.{n}g}" != f"{limit:.{n}g}"), 17)
    return f"{value:.{digits}g}" + _spell_unit(unit)


def spell_limit(limit: float, unit: str = "") -> str:
    """Return a limit as it was set, with its unit."""
    return f"{limit:.6g}" + _spell_unit(unit)


def _spell_unit(unit: str) -> str:
    signs = {"deg": "°", "deg/s": "°/s", "count": "", "–": "", "-": "", "%": " %"}
    return signs.get(unit, f" {unit}" if unit else "")


@dataclass(frozen=True)
class UsedLimit:
    """How much of its limit a check used: ``share`` is 1 at the limit, ``is_least`` where the limit is a least value."""

    name: str
    title: str
    share: float
    value: float
    limit: float
    unit: str
    is_least: bool
    is_failed: bool

    def __str__(self) -> str:
        bound = "at least" if self.is_least else "at most"
        return (
            f"{spell_beside(self.value, self.limit, self.unit)}, {bound} {spell_limit(self.limit, self.unit)}"
        )


def list_used_limits(report: ValidationReport) -> tuple[UsedLimit, ...]:
    """Return how much of its limit each check used, the nearest to its limit first.

    Checks without a value, without a limit, or whose limit is zero, of which nothing can be a share, are left out.
    """
    found = []
    for check in report.checks:
        if check.status not in (PASSED, FAILED) or check.value is None or not check.limit:
            continue
        is_failed = check.status == FAILED
        # A value beyond its limit passes only where the limit is a least value, and fails only where it is a largest one.
        is_least = (check.value > check.limit) != is_failed and check.value != check.limit
        share = check.limit / check.value if is_least and check.value else check.value / check.limit
        share = float("inf") if is_least and check.value <= 0.0 else share
        title = describe_check(check.name).title
        found.append(
            UsedLimit(check.name, title, share, check.value, check.limit, check.unit, is_least, is_failed)
        )
    return tuple(sorted(found, key=lambda used: (-used.share, used.name)))
