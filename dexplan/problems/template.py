"""The problem file that a newcomer starts from: every key with what it means, what it accepts and its default.

Lines that begin with ``# `` are words; ``#key = value``, without the space, is a key that is left out and has this default.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Any

import tomli_w

from dexplan.problems.meanings import TABLES, describe_meaning
from dexplan.problems.rules import ACCEPTED, BOUNDS, SCENES, load_joint_ranges, load_limits
from dexplan.problems.sections import FORMAT, GoalSection, ProblemFields
from dexplan.sim.judge.limits import INTEGRITY

SCHEMA_FILE = "problem.schema.json"
"""What the template calls the schema beside it."""
LONGEST_LINE = 110

_EXAMPLES: dict[str, str] = {
    "name": '"my_problem"',
    "object.allowed_regions": "[{ axis = [0.0, 0.0, 1.0], half_angle_deg = 120.0 }]",
    "object.shape": '{ kind = "box", half_sizes_m = [0.03, 0.03, 0.03] }',
    "object.com_m": "[0.0, 0.0, -0.005]",
    "object.inertia_kg_m2": "[3e-5, 3e-5, 3e-5]",
    "goal.orientation_wxyz": "[0.924, 0.0, 0.0, 0.383]",
    "goal.waypoints": "[{ translation_m = [0.0, 0.0, 0.01] }, { rotation = { axis = [0.0, 0.0, 1.0], angle_deg = 45.0 } }]",
    "goal.contacts_deg": '[[-38.0, 0.0], [102.0, 0.0], "free"]',
}
"""Values shown of keys without a default."""
_OBSTACLE = {"kind": '"box"', "pos_m": "[0.2, 0.0, 0.1]", "size_m": "[0.02, 0.02, 0.05]"}


def build_template(file: str = "my_problem.toml") -> str:
    """Return the text of a problem file that can be run as it is: a quarter turn; everything else is left at its default.

    ``file`` is what the text calls itself.
    """
    return "\n".join(_write_lines(file)) + "\n"


def _write_lines(file: str) -> Iterator[str]:
    defaults = ProblemFields(name="", goal=GoalSection()).as_dict()
    yield f"#:schema {SCHEMA_FILE}"
    yield f"# A problem for dexplan: `dexplan plan {file}` plans it, `dexplan run {file}` lets MuJoCo judge the plan."
    yield "# A key behind a # is left out and has the default that stands there; take the # away to set it."
    yield "# Unknown keys, wrong types and numbers out of range are refused before anything runs."
    yield f"# Editors that know TOML schemas complete and check this file once `dexplan schema {SCHEMA_FILE}` was called here."
    yield ""
    yield f"format = {FORMAT}"
    for key in ("name", "summary", "scene", "seed"):
        yield from _write_key(key, defaults[key])
    for table, section in defaults.items():
        if table == "obstacles":
            yield from _write_obstacles()
        elif table == "acceptance":
            yield from _write_limits()
        elif isinstance(section, dict):
            yield from _write_table(table, section)


def _write_table(table: str, section: dict[str, Any]) -> Iterator[str]:
    yield ""
    yield f"[{table}]  # {TABLES[table]}"
    if table == "object":
        section = {
            "radius_m": None,
            "shape": None,
            "mass_kg": None,
            "com_m": None,
            "inertia_kg_m2": None,
            **section,
        }
    if table == "goal":
        # What has no default is not among the defaults.
        section = {
            "kind": section["kind"],
            "rotation": None,
            "orientation_wxyz": None,
            "contacts_deg": None,
            **section,
            "waypoints": None,
        }
    for name, default in section.items():
        key = f"{table}.{name}"
        if key == "goal.rotation":
            yield from _write_words(key)
            yield "rotation = { axis = [0.0, 0.0, 1.0], angle_deg = 90.0 }"
        elif key == "hand.joint_ranges_deg":
            joint, (lowest, highest) = next(iter(load_joint_ranges().items()))
            yield from _write_words(key)
            yield f'#joint_ranges_deg = {{ "finger_1.{joint}" = [{lowest:g}, {highest:g}] }}'
        elif isinstance(default, dict):
            yield from _write_inner(key, default)
        else:
            yield from _write_key(key, default)


def _write_inner(key: str, defaults: dict[str, Any]) -> Iterator[str]:
    """Write a table inside a table, as dotted keys: a table of its own would end the one that it stands in."""
    name = key.rpartition(".")[2]
    yield from _wrap(f"{name}: {TABLES[key]}")
    for inner, default in defaults.items():
        yield from _write_words(f"{key}.{inner}")
        yield f"#{name}.{inner} = {_spell(default)}"


def _write_key(key: str, default: object) -> Iterator[str]:
    yield from _write_words(key)
    yield f"#{key.rpartition('.')[2]} = {_EXAMPLES.get(key) or _spell(default)}"


def _write_words(key: str) -> Iterator[str]:
    told = describe_meaning(key)
    accepted = _describe_accepted(key)
    example = "; no default, this is an example" if key in _EXAMPLES and key != "name" else ""
    if key == "goal.rotation":
        accepted = f"{accepted}, axis not zero, angle_deg {_spell_range(f'{key}.angle_deg')}"
    yield from _wrap(f"{told}. Accepted: {accepted}{example}")


def _describe_accepted(key: str) -> str:
    """Return what the key accepts: in words, with the bounds of its numbers."""
    if key == "scene":
        return " or ".join(f'"{name}"' for name in SCENES)
    words, bounds = ACCEPTED.get(key, ""), BOUNDS.get(key)
    if words and bounds is not None and key not in ("seed", "gait.node_budget", "goal.orientation_wxyz"):
        return f"{words}, each {_spell_range(key)}"
    if key == "object.allowed_regions":
        return f"{words}, axis not zero, half_angle_deg {_spell_range(f'{key}.half_angle_deg')}"
    return words or str(bounds)


def _spell_range(key: str) -> str:
    """Return the bounds of a number, from the word "from" on."""
    return str(BOUNDS[key]).removeprefix("a number ")


def _write_obstacles() -> Iterator[str]:
    yield ""
    yield from _wrap(f"obstacles: {TABLES['obstacles']}; left out: none; no defaults, this is an example")
    yield "#[[obstacles]]"
    for name, example in _OBSTACLE.items():
        key = f"obstacles.{name}"
        words = ACCEPTED.get(f"obstacles[].{name}", "")
        if key in BOUNDS:
            words += f", each {_spell_range(key)}"
        yield from _wrap(f"{describe_meaning(key)}. Accepted: {words}")
        yield f"#{name} = {example}"


def _write_limits() -> Iterator[str]:
    yield ""
    yield f"[acceptance]  # {TABLES['acceptance']}"
    yield from _wrap("each a number, 0 or more; a name with _min is a least value, any other a largest one")
    for name, default in load_limits().items():
        fixed = f"; cannot be changed, since {INTEGRITY[name]}" if name in INTEGRITY else ""
        yield from _wrap(describe_meaning(f"acceptance.{name}") + fixed)
        yield f"#{name} = {_spell(default)}"


def _wrap(text: str) -> Iterator[str]:
    for line in textwrap.wrap(text, LONGEST_LINE - 2, break_on_hyphens=False):
        yield f"# {line}"


def _spell(value: object) -> str:
    """Return a value as TOML, in one line."""
    text = tomli_w.dumps({"x": value}, indent=0).partition("=")[2]
    return " ".join(text.split()).replace("[ ", "[").replace(",]", "]").replace(", ]", "]")
