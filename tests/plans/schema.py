"""A small reader of JSON schemas: as much of the standard as ``docs/plan.schema.json`` uses, and an error for anything else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,), "array": (list,), "string": (str,), "number": (int, float), "integer": (int,),
    "boolean": (bool,), "null": (type(None),),
}  # fmt: skip
ANNOTATIONS = {"$schema", "$defs", "title", "description"}
KNOWN = ANNOTATIONS | {
    "$ref", "type", "const", "enum", "oneOf", "properties", "required", "additionalProperties", "items",
    "minItems", "maxItems", "minimum", "maximum", "exclusiveMinimum",
}  # fmt: skip


def find_faults(
    data: Any, schema: Mapping[str, Any], root: Mapping[str, Any], where: str = ""
) -> Iterator[str]:
    """Yield one sentence per place in which ``data`` is not as ``schema`` says; references are looked up in ``root``."""
    unknown = set(schema) - KNOWN
    assert not unknown, f"{where}: this reader does not know {unknown}"
    if "$ref" in schema:
        yield from find_faults(data, _look_up(schema["$ref"], root), root, where)
    if "const" in schema and data != schema["const"]:
        yield f"{where}: {data!r} is not {schema['const']!r}"
    if "enum" in schema and data not in schema["enum"]:
        yield f"{where}: {data!r} is none of {schema['enum']}"
    if "oneOf" in schema:
        found = [list(find_faults(data, option, root, where)) for option in schema["oneOf"]]
        if sum(not faults for faults in found) != 1:
            yield f"{where}: {sum(not f for f in found)} of {len(found)} options fit ({min(found, key=len)[:3]})"
    if "type" in schema:
        names = [schema["type"]] if isinstance(schema["type"], str) else schema["type"]
        allowed = tuple(kind for name in names for kind in TYPES[name])
        if not isinstance(data, allowed) or (isinstance(data, bool) and "boolean" not in names):
            yield f"{where}: {type(data).__name__} is not {' or '.join(names)}"
            return
    if isinstance(data, dict):
        yield from _find_in_object(data, schema, root, where)
    if isinstance(data, list):
        if not schema.get("minItems", 0) <= len(data) <= schema.get("maxItems", len(data)):
            yield f"{where}: {len(data)} items"
        for k, item in enumerate(data):
            yield from find_faults(item, schema.get("items", {}), root, f"{where}[{k}]")
    if isinstance(data, int | float):
        is_low = data < schema.get("minimum", data) or data <= schema.get("exclusiveMinimum", data - 1)
        if is_low or data > schema.get("maximum", data):
            yield f"{where}: {data} is out of bounds"


def _find_in_object(
    data: dict[str, Any], schema: Mapping[str, Any], root: Mapping[str, Any], where: str
) -> Iterator[str]:
    properties, other = schema.get("properties", {}), schema.get("additionalProperties", True)
    for name in schema.get("required", ()):
        if name not in data:
            yield f"{where}: lacks {name}"
    for name, value in data.items():
        if name in properties:
            yield from find_faults(value, properties[name], root, f"{where}.{name}")
        elif other is False:
            yield f"{where}: has {name}"
        elif isinstance(other, dict):
            yield from find_faults(value, other, root, f"{where}.{name}")


def _look_up(reference: str, root: Mapping[str, Any]) -> Mapping[str, Any]:
    found: Any = root
    for name in reference.removeprefix("#/").split("/"):
        found = found[name]
    return found
