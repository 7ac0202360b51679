"""Parts of the pages that are written by ``scripts/docs`` and not by hand: examples, and tables of what files may say.

They stand between ``<!-- written by scripts/docs: NAME -->`` and ``<!-- end -->``; NAME is the path of an example, or a key of
:data:`TABLES`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import tomli_w

ROOT = Path(__file__).resolve().parents[1]
MARKED = re.compile(r"(<!-- written by scripts/docs: (.+?) -->\n)(.*?)(<!-- end -->)", re.DOTALL)


def find_marks(page: str) -> list[str]:
    """Return the names of the written parts of a page."""
    return [name for _, name, _, _ in MARKED.findall(page)]


def rewrite(page: str) -> str:
    """Return the text of a page with its written parts as they are now."""
    return MARKED.sub(lambda found: f"{found[1]}{write_part(found[2])}{found[4]}", page)


def write_part(name: str) -> str:
    """Return a written part by its name; KeyError for a name that is none."""
    path = ROOT / name
    if name.startswith("examples/") and path.is_file():
        language = {".py": "python", ".toml": "toml", ".xml": "xml"}[path.suffix]
        # A file that commands of the page use is named in its first line.
        return f"```{language}\n{path.read_text(encoding='utf-8')}```\n"
    return TABLES[name]()


@cache
def _read_plan_schema() -> Mapping[str, Any]:
    data: Mapping[str, Any] = json.loads((ROOT / "docs" / "plan.schema.json").read_text(encoding="utf-8"))
    return data


def describe_plan() -> str:
    """Return tables of everything that stands in ``plan.json``; what all actions have stands in one of its own."""
    schema = _read_plan_schema()
    kinds = [one["$ref"].rpartition("/")[2] for one in schema["properties"]["actions"]["items"]["oneOf"]]
    actions = [schema["$defs"][kind] for kind in kinds]
    shared = {
        key: value
        for key, value in actions[0]["properties"].items()
        if all(one["properties"].get(key) == value for one in actions)
    }
    every = {"description": "What every action has; its kind adds what stands there.", "properties": shared}
    parts = [
        *_write_object("plan", schema),
        *_write_object("every action", {**every, "required": list(shared)}),
    ]
    for name, one in schema["$defs"].items():
        if name in kinds:
            own = {key: value for key, value in one["properties"].items() if key not in shared}
            one = {**one, "properties": own}
        parts += _write_object(name, one)
    return "\n".join(parts) + "\n"


def _write_object(name: str, schema: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of one object's heading and table; of anything else, its type and what it is."""
    yield f"#### {name}\n"
    about = _escape(schema.get("description", ""))
    if "properties" not in schema:
        yield f"{_capital(_spell_type(schema))}. {about}\n"
        return
    yield f"{about}\n"
    yield "| key | what it is | meaning |"
    yield "| --- | --- | --- |"
    required = schema.get("required", ())
    for key, one in _flatten(schema["properties"]):
        optional = "" if key in required or "." in key else " (may be left out)"
        yield f"| `{key}` | {_spell_type(one)}{optional} | {_escape(one.get('description', ''))} |"
    yield ""


def _flatten(properties: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield keys with their schemas; those of objects inside with a dot."""
    for key, one in properties.items():
        yield before + key, one
        if "properties" in one:
            yield from _flatten(one["properties"], f"{before}{key}.")


def _spell_type(schema: Mapping[str, Any]) -> str:
    """Return in words what a schema accepts."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{name})"
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if "enum" in schema:
        return " or ".join(f"`{value}`" for value in schema["enum"])
    if "oneOf" in schema:
        return " or ".join(_spell_type(one) for one in schema["oneOf"])
    kinds = (
        [schema["type"]] if isinstance(schema.get("type"), str) else list(schema.get("type", ["anything"]))
    )
    return " or ".join(_spell_kind(kind, schema) for kind in kinds)


def _spell_kind(kind: str, schema: Mapping[str, Any]) -> str:
    if kind == "array":
        least, most = schema.get("minItems"), schema.get("maxItems")
        inner = _spell_type(schema.get("items", {}))
        if inner in ("number", "string"):
            inner += "s"
        return f"{least} {inner}" if least is not None and least == most else f"list of {inner}"
    if kind == "object" and isinstance(schema.get("additionalProperties"), dict):
        return f"by name: {_spell_type(schema['additionalProperties'])}"
    return {"null": "`null`", "integer": "whole number", "boolean": "true or false"}.get(kind, kind)


def _escape(text: str) -> str:
    return re.sub(r"\s+", " ", text).replace("|", "\\|").strip()


def describe_problem() -> str:
    """Return a table per table of a problem file: every key with its default, what it accepts and what it means."""
    from dexplan.problems.meanings import TABLES as ABOUT
    from dexplan.problems.sections import FORMAT, GoalSection, ProblemFields

    defaults = ProblemFields(name="", goal=GoalSection()).as_dict()
    top = {
        key: value for key, value in defaults.items() if not isinstance(value, dict) and key != "obstacles"
    }
    parts = ["## At the top", "", *_write_keys({**top, "format": FORMAT, "name": _NO_DEFAULT})]
    for table, about in ABOUT.items():
        if table == "acceptance":
            continue
        name = f"[[{table}]]" if table == "obstacles" else f"[{table}]"
        parts += ["", f"## {name}", "", f"{_capital(about)}.", ""]
        parts += _write_keys(dict(_find_keys(table, defaults)))
    return "\n".join(parts) + "\n"


_NO_DEFAULT = object()
_DERIVED = ("name", "goal.kind", "friction.torsional_m", "forces.normal_floor_N", "forces.normal_ceiling_N")
"""Keys whose default follows from others, as their meanings say."""


def _find_keys(table: str, defaults: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the keys of a table with their defaults, those without one as well."""
    from dexplan.problems.meanings import KEYS
    from dexplan.problems.meanings import TABLES as ABOUT

    for key in KEYS:
        homes = [other for other in ABOUT if key.startswith(f"{other}.")]
        if not homes or max(homes, key=len) != table:
            continue
        value: Any = defaults
        for step in key.split("."):
            value = value.get(step, _NO_DEFAULT) if isinstance(value, dict) else _NO_DEFAULT
        yield key, _NO_DEFAULT if value == {} else value


def _write_keys(keys: Mapping[str, Any]) -> Iterator[str]:
    from dexplan.problems.meanings import KEYS

    yield "| key | default | accepts | meaning |"
    yield "| --- | --- | --- | --- |"
    for key, default in keys.items():
        shown = "" if default is _NO_DEFAULT or key in _DERIVED else f"`{_spell_toml(default)}`"
        meaning = "the format of the file; has to be there" if key == "format" else KEYS[key]
        yield f"| `{key}` | {shown} | {_escape(_spell_accepted(key))} | {_escape(_capital(meaning))} |"


def _spell_accepted(key: str) -> str:
    """Return in words what a key of a problem file accepts, with the bounds of its numbers."""
    from dexplan.problems.rules import ACCEPTED, BOUNDS, SCENES

    if key == "format":
        return "1"
    if key == "scene":
        return " or ".join(f'"{name}"' for name in SCENES)
    in_list = re.sub(r"(obstacles|allowed_regions|contacts_deg)\.", r"\1[].", key)
    words = ACCEPTED.get(key) or ACCEPTED.get(in_list, "")
    bounds = BOUNDS.get(key)
    if words and bounds is not None and "whole number" not in words and bounds.highest < 1e6:
        return f"{words}; {bounds}"
    return words or str(bounds or _THREE)


_THREE = "three numbers [x, y, z]"


def describe_limits() -> str:
    """Return a table of the limits of ``[acceptance]``."""
    from dexplan.problems.meanings import describe_meaning
    from dexplan.problems.rules import load_limits
    from dexplan.sim.judge.limits import INTEGRITY

    lines = ["| key | default | meaning |", "| --- | --- | --- |"]
    for name, default in load_limits().items():
        fixed = " Cannot be changed." if name in INTEGRITY else ""
        meaning = _escape(_capital(describe_meaning(f"acceptance.{name}")))
        lines.append(f"| `{name}` | `{_spell_toml(default)}` | {meaning}.{fixed} |")
    return "\n".join(lines) + "\n"


def describe_checks() -> str:
    """Return a table of the judge's checks for each of their groups."""
    from dexplan.sim.judge.groups import GROUPS
    from dexplan.viz.check_words import GROUP_QUESTIONS, describe_check

    parts = []
    for group, checks in GROUPS.items():
        parts += [
            f"**{_capital(group)}.** {GROUP_QUESTIONS[group]}",
            "",
            "| check | what it says |",
            "| --- | --- |",
        ]
        parts += [f"| `{name}` | {_escape(describe_check(name).meaning)} |" for name in checks]
        parts.append("")
    return "\n".join(parts)


def _spell_toml(value: object) -> str:
    """Return a value as TOML, in one line."""
    text = tomli_w.dumps({"x": value}, indent=0).partition("=")[2]
    return re.sub(r",\s*\]", "]", " ".join(text.split()).replace("[ ", "["))


def _capital(text: str) -> str:
    return text if text.startswith("sqrt") else text[:1].upper() + text[1:]


TABLES: Mapping[str, Callable[[], str]] = {
    "plan.json": describe_plan,
    "problem file": describe_problem,
    "limits": describe_limits,
    "checks": describe_checks,
}
"""Written part -> what writes it."""
