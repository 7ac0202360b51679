"""``--set KEY=VALUE``: replace one value of a problem file by a dotted key.

Keys are written as in TOML (``goal.rotation.angle_deg``, ``hand.joint_ranges_deg."finger_1.joint_1"``),
entries of lists by their number (``hand.tip_radii_m.1``), values as in TOML; a bare word is text, for shells take quotes away.
"""

from __future__ import annotations

import re
import tomllib
from typing import Any

from dexplan.errors import ProblemError
from dexplan.problems.rules import spell
from dexplan.problems.sections import GoalSection, ProblemFields

OPTION = "--set"
WORD = re.compile(r"[A-Za-z./][A-Za-z0-9_./-]*")
"""A bare word, or the path of a file."""


def parse_assignment(text: str, option: str = OPTION) -> tuple[str, object]:
    """Return (dotted key, value) of one ``KEY=VALUE`` given to ``option``, the value parsed as TOML."""
    key, equals, value_text = text.partition("=")
    if not equals or not key.strip() or not value_text.strip():
        accepted = "accepted: KEY=VALUE such as goal.rotation.angle_deg=90"
        raise ProblemError(option, "", f"{spell(text)} is no assignment", accepted)
    _parse_key(key.strip(), option)
    return key.strip(), _parse_value(key.strip(), value_text.strip(), option)


def set_override(data: dict[str, Any], dotted_key: str, toml_value_text: str) -> None:
    """Replace the value at ``dotted_key`` of the problem dict ``data``, in place, by the TOML value in the
    text.
    """
    apply_override(data, dotted_key, _parse_value(dotted_key, toml_value_text.strip(), OPTION), OPTION)


def apply_override(data: dict[str, Any], dotted_key: str, value: object, source: str) -> None:
    """Replace the value at ``dotted_key`` of ``data`` in place; lists the file leaves out start from their
    defaults.
    """
    steps = _parse_key(dotted_key, source)
    defaults: Any = ProblemFields(name="", goal=GoalSection()).as_dict()
    place: Any = data
    for depth, step in enumerate(steps):
        is_last = depth == len(steps) - 1
        defaults = defaults.get(step) if isinstance(defaults, dict) else None
        if isinstance(place, list):
            index = _parse_index(step, len(place), dotted_key, source)
            if is_last:
                place[index] = value
            place = place[index]
        elif isinstance(place, dict):
            if is_last:
                place[step] = value
            elif step not in place:
                # An index needs the default list to stand in; a table's other defaults come by themselves.
                place[step] = list(defaults) if isinstance(defaults, list) else {}
            place = place[step]
        else:
            fact = f"{spell(place)} has nothing below it"
            raise ProblemError(
                source, dotted_key, fact, "accepted: the key of a table, or the number of a list's entry"
            )


def _parse_index(step: str, count: int, dotted_key: str, source: str) -> int:
    if not (step.isascii() and step.isdecimal() and len(step) < 7 and int(step) < count):
        accepted = f"accepted: 0 to {count - 1}" if count else "accepted: the whole list as a value"
        raise ProblemError(source, dotted_key, f"no entry {spell(step)} in a list of {count}", accepted)
    return int(step)


def _parse_key(dotted_key: str, source: str) -> list[str]:
    """Return the steps of a dotted key, read by TOML's own rules (quotes included)."""
    accepted = "accepted: a dotted key such as goal.rotation.angle_deg"
    try:
        if "\n" in dotted_key or "=" in dotted_key or "#" in dotted_key or "[" in dotted_key:
            raise ValueError
        tree: Any = tomllib.loads(f"{dotted_key} = 0")
    except (ValueError, RecursionError):
        raise ProblemError(source, "", f"{spell(dotted_key)} is no key", accepted) from None
    steps: list[str] = []
    while isinstance(tree, dict):
        step, tree = next(iter(tree.items()))
        steps.append(step)
    return steps


def _parse_value(key: str, text: str, option: str) -> object:
    """Return the TOML value in ``text``, which may hold nothing else, or the bare word that it is."""
    try:
        tree = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        tree = {}
    if set(tree) != {"value"}:
        if WORD.fullmatch(text):
            return text
        accepted = "accepted: a TOML value such as 90, true or [1.0, 2.0], or a word"
        raise ProblemError(option, key, f"{spell(text)} is no value", accepted)
    return tree["value"]
