"""The JSON schema of problem files, for editors that complete and check TOML: made of the sections, bounds and meanings.

A schema knows types, bounds and words; what depends on several keys at once is only known to reading the file.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from dexplan.problems.meanings import describe_meaning
from dexplan.problems.rules import AZIMUTH, BOUNDS, ELEVATION, NAME_PATTERN, SCENES, Bounds, load_limits
from dexplan.problems.sections import FORMAT, ProblemFields
from dexplan.sim.judge.limits import INTEGRITY

DIALECT = "http://json-schema.org/draft-07/schema#"
"""What editors' TOML plugins read."""
TITLE = "A problem file of dexplan"
DERIVED = ("name", "goal.kind", "friction.torsional_m", "forces.normal_floor_N", "forces.normal_ceiling_N")
"""Keys whose default depends on others: no default is stated for them."""


def build_schema() -> dict[str, Any]:
    """Return the schema as JSON data; every key has its meaning as ``description``, numbers have their bounds."""
    raw = msgspec.json.schema(ProblemFields)
    schema = _rewrite(raw, raw["$defs"], "")
    format_key = {"const": FORMAT, "description": "the format of the file"}
    schema["properties"] = {"format": format_key, **schema["properties"]}
    schema["required"] = ["format", "goal"]
    return {"$schema": DIALECT, "title": TITLE, **schema}


def build_schema_text() -> str:
    """Return the schema as the text of a file."""
    return json.dumps(build_schema(), indent=1) + "\n"


def is_schema(path: Path) -> bool:
    """Whether the file at ``path`` is a schema that this module wrote, of whatever version."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(data, dict) and data.get("title") == TITLE


def _rewrite(node: Mapping[str, Any], defs: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Return a node of msgspec's schema with references resolved, bounds and meanings of ``key`` written in."""
    if "$ref" in node:
        target = defs[node["$ref"].rpartition("/")[2]]
        return _rewrite({**target, **{k: v for k, v in node.items() if k != "$ref"}}, defs, key)
    if "anyOf" in node:
        out = _rewrite_union(node["anyOf"], defs, key)
    elif key == "acceptance":
        out = _describe_limits()
    elif key == "hand.joint_ranges_deg":
        out = {"type": "object"}
    elif node.get("type") == "object":
        properties = {
            name: _rewrite(inner, defs, f"{key}.{name}" if key else name)
            for name, inner in node["properties"].items()
        }
        out = {"type": "object", "properties": properties, "additionalProperties": False}
        if node.get("required"):
            out["required"] = list(node["required"])
    elif node.get("type") == "array":
        out = _rewrite_array(node, defs, key)
    else:
        out = _rewrite_value(node, key)
    if "default" in node and node["default"] is not None and key not in DERIVED:
        default = node["default"]
        out["default"] = list(default) if isinstance(default, tuple) else default
    if key and not key.endswith("[]"):
        out["description"] = describe_meaning(key.replace("[]", ""))
    return out


def _rewrite_union(options: list[Mapping[str, Any]], defs: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Return a choice; what may be left out needs no null, which TOML has not."""
    kept = [_rewrite(option, defs, f"{key}[]") for option in options if option.get("type") != "null"]
    if key == "goal.orientation_wxyz":
        kept.append({"const": "random"})
    for option in kept:
        option.pop("description", None)
    return kept[0] if len(kept) == 1 else {"anyOf": kept}


def _rewrite_array(node: Mapping[str, Any], defs: Mapping[str, Any], key: str) -> dict[str, Any]:
    if "prefixItems" not in node:
        return {"type": "array", "items": _rewrite(node["items"], defs, f"{key}[]")}
    count = len(node["prefixItems"])
    bare = key.replace("[]", "")
    if bare == "object.inertia_kg_m2":
        # Principal moments, or rows of a matrix.
        row = _repeat(_bound(BOUNDS[bare]), count)
        return {"anyOf": [row, _repeat(row, count)]}
    if bare in ("start.contacts_deg", "goal.contacts_deg"):
        # Azimuth and elevation: the older dialect takes a list of schemas, one per place.
        items: object = [_bound(AZIMUTH), _bound(ELEVATION)]
    else:
        items = _bound(BOUNDS[bare]) if bare in BOUNDS else {"type": "number"}
    return _repeat(items, count)


def _repeat(items: object, count: int) -> dict[str, Any]:
    return {"type": "array", "minItems": count, "maxItems": count, "items": items}


def _rewrite_value(node: Mapping[str, Any], key: str) -> dict[str, Any]:
    bare = key.replace("[]", "")
    if "enum" in node:
        return {"enum": list(node["enum"])}
    if bare == "scene":
        return {"enum": list(SCENES)}
    if bare == "name":
        return {"type": "string", "pattern": f"^{NAME_PATTERN.pattern}$"}
    if bare == "summary":
        return {"type": "string", "maxLength": 200}
    if bare in BOUNDS:
        return {**_bound(BOUNDS[bare]), "type": node["type"]}
    return {"type": node["type"]}


def _bound(bounds: Bounds) -> dict[str, Any]:
    return {"type": "number", "minimum": bounds.lowest, "maximum": bounds.highest}


def _describe_limits() -> dict[str, Any]:
    properties: dict[str, Any] = {}
    for name, default in load_limits().items():
        kind: dict[str, Any] = (
            {"type": "boolean"} if isinstance(default, bool) else {"type": "number", "minimum": 0.0}
        )
        if name in INTEGRITY:
            kind = {"const": default}
        properties[name] = {**kind, "default": default, "description": describe_meaning(f"acceptance.{name}")}
    return {"type": "object", "properties": properties, "additionalProperties": False}
