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
        language = {".py": "python", ".toml": "toml"}[path.suffix]
        # A file that commands of the page use is named in its first line.
        return f"```{language}\n{path.read_text(encoding='utf-8')}```\n"
    return TABLES[name]()


@cache
def _read_plan_schema() -> Mapping[str, Any]:
    data: Mapping[str, Any] = json.loads((ROOT / "docs" / "plan.schema.json").read_text(encoding="utf-8"))
    return data


def describe_plan() -> str:
    """Return tables of everything that stands in ``plan.json``."""
    schema = _read_plan_schema()
    parts = [*_write_object("plan", schema)]
    for name, one in schema["$defs"].items():
        parts += _write_object(name, one)
    return "\n".join(parts) + "\n"


def _write_object(name: str, schema: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of one object's heading and table; of anything else, one line."""
    kind = schema.get("type")
    is_object = "properties" in schema
    yield f"#### {name}\n"
    yield _escape(schema.get("description", "")) + "\n"
    if not is_object:
        yield f"{_spell_type(schema)}.\n"
        return
    assert kind == "object" or "object" in (kind or ())
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
    kinds = [schema["type"]] if isinstance(schema.get("type"), str) else list(schema.get("type", ["anything"]))
    return " or ".join(_spell_kind(kind, schema) for kind in kinds)


def _spell_kind(kind: str, schema: Mapping[str, Any]) -> str:
    if kind == "array":
        least, most = schema.get("minItems"), schema.get("maxItems")
        count = f"{least} " if least is not None and least == most else ""
        return f"list of {count}{_spell_type(schema.get('items', {}))}"
    if kind == "object" and isinstance(schema.get("additionalProperties"), dict):
        return f"by finger: {_spell_type(schema['additionalProperties'])}"
    return {"null": "`null`", "integer": "whole number", "boolean": "true or false"}.get(kind, kind)


def _escape(text: str) -> str:
    return re.sub(r"\s+", " ", text).replace("|", "\\|").strip()


TABLES: Mapping[str, Callable[[], str]] = {"plan.json": describe_plan}
"""Written part -> what writes it."""
