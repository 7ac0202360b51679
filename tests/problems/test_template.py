"""``dexplan new``, ``schema`` and ``show``: what they write is made of the code, and the code reads it."""

from __future__ import annotations

import json
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from dexplan.cli import main
from dexplan.errors import ProblemError
from dexplan.problems.meanings import KEYS, TABLES, describe_meaning, read_limit_meanings
from dexplan.problems.read import build_problem, list_problems, load_problem
from dexplan.problems.rules import BOUNDS, load_limits
from dexplan.problems.schema import build_schema, build_schema_text
from dexplan.problems.sections import GoalSection, ProblemFields
from dexplan.problems.template import SCHEMA_FILE, build_template
from dexplan.problems.words import spell_problem

TEMPLATE = build_template()
KEY = re.compile(r"#?([a-z]\w*(?:\.\w+)?) = (.*)")


def walk_keys(schema: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield every key of the schema with its own part, lists of tables included."""
    for name, part in schema.get("properties", {}).items():
        key = f"{above}.{name}" if above else name
        yield key, part
        inner = part.get("items")
        yield from walk_keys(inner if isinstance(inner, dict) else part, key)


ALL_KEYS = dict(walk_keys(build_schema()))


def read_template_keys() -> dict[str, str]:
    """Return every key of the template, commented or not, with its value as text."""
    found, table = {}, ""
    for line in TEMPLATE.splitlines():
        if match := re.match(r"#?\[+(\w+)\]+", line):
            table = f"{match[1]}."
        elif match := KEY.fullmatch(line):
            found[table + match[1]] = match[2]
    return found


def take_the_mark_away(key: str) -> str:
    """Return the template with one key set to the value that stands there."""
    table, _, name = key.rpartition(".") if key.count(".") < 2 else key.partition(".")
    lines, here = [], ""
    for line in TEMPLATE.splitlines():
        if match := re.match(r"#?\[+(\w+)\]+", line):
            here = match[1]
        is_it = here == table and line.startswith(f"#{name} = ")
        lines.append(line[1:] if is_it or (table == here == "obstacles" and re.match(r"#\S", line)) else line)
    return "\n".join(lines)


def test_every_key_means_something() -> None:
    numbers = {key for key in BOUNDS if not key.startswith("acceptance")}
    assert numbers <= set(KEYS)
    assert set(read_limit_meanings()) == set(load_limits())
    for key in ALL_KEYS:
        if key != "format":
            assert describe_meaning(key)
    known = {key for key in ALL_KEYS if not key.startswith("acceptance.")}
    assert set(KEYS) | set(TABLES) | {"format"} == known | {
        "start.contacts_deg.point_m",
        "goal.contacts_deg.point_m",
    }


def test_the_template_holds_every_key() -> None:
    inner = (
        "object.allowed_regions.",
        "object.shape.",
        "goal.rotation.",
        "goal.waypoints.",
        "start.contacts_deg.",
        "goal.contacts_deg.",
    )
    wanted = {k for k in ALL_KEYS if not k.startswith(inner) and k not in TABLES}
    assert set(read_template_keys()) == wanted
    assert TEMPLATE.startswith(f"#:schema {SCHEMA_FILE}\n")


def test_the_template_can_be_run_as_it_is() -> None:
    problem = build_problem(tomllib.loads(TEMPLATE), "template", "quarter")
    assert problem == build_problem(
        {"format": 1, "name": "quarter", "goal": {"rotation": {"axis": [0, 0, 1], "angle_deg": 90}}}
    )


EXAMPLES = {
    "goal.orientation_wxyz",
    "goal.contacts_deg",
    "goal.waypoints",
    "object.allowed_regions",
    "object.com_m",
    "object.inertia_kg_m2",
    "object.shape",
    "hand.joint_ranges_deg",
    "name",
}


@pytest.mark.parametrize("key", [k for k in read_template_keys() if k not in ("format", "goal.rotation")])
def test_each_key_can_be_set_to_what_stands_there(key: str) -> None:
    text = take_the_mark_away(key)
    if key in ("goal.orientation_wxyz", "goal.waypoints"):
        text = text.replace("\nrotation = ", "\n#rotation = ")
    if key == "goal.contacts_deg":
        text = text.replace('\n#kind = "object_manipulation"', "")
    assert text != TEMPLATE
    problem = build_problem(tomllib.loads(text), "template", "quarter")
    if key in EXAMPLES or key.startswith("obstacles."):
        return
    assert problem == build_problem(tomllib.loads(TEMPLATE), "template", "quarter"), (
        "what stands there is the default"
    )


def test_defaults_of_the_template_and_the_schema_are_those_of_the_code() -> None:
    defaults = ProblemFields(name="", goal=GoalSection()).as_dict()
    defaults["acceptance"] = load_limits()
    for key, part in ALL_KEYS.items():
        if "default" in part and not key.startswith("goal.waypoints."):
            value: Any = defaults
            for step in key.split("."):
                value = value[step]
            assert json.loads(json.dumps(value)) == part["default"], key


def find_faults(data: Any, schema: Mapping[str, Any], where: str = "") -> Iterator[str]:
    """Yield where ``data`` is not as ``schema`` says: as much of JSON schema as ours uses."""
    known = {
        "type", "properties", "required", "additionalProperties", "items", "minItems", "maxItems", "anyOf", "const",
        "enum", "minimum", "maximum", "pattern", "maxLength", "default", "description", "title", "$schema",
    }  # fmt: skip
    assert set(schema) <= known
    types: dict[str, tuple[type, ...]] = {
        "object": (dict,), "array": (list,), "string": (str,), "boolean": (bool,), "integer": (int,), "number": (int, float),
    }  # fmt: skip
    if "anyOf" in schema:
        if all(list(find_faults(data, option, where)) for option in schema["anyOf"]):
            yield f"{where}: nothing fits"
        return
    if ("const" in schema and data != schema["const"]) or ("enum" in schema and data not in schema["enum"]):
        yield f"{where}: {data!r}"
        return
    kind = schema.get("type")
    if kind and (not isinstance(data, types[kind]) or (isinstance(data, bool) and kind != "boolean")):
        yield f"{where}: {data!r} is not {kind}"
    elif isinstance(data, dict):
        properties = schema.get("properties", {})
        yield from (f"{where}: lacks {name}" for name in schema.get("required", ()) if name not in data)
        for name, value in data.items():
            if name in properties:
                yield from find_faults(value, properties[name], f"{where}.{name}")
            elif schema.get("additionalProperties") is False:
                yield f"{where}: has {name}"
    elif isinstance(data, list):
        if not schema.get("minItems", 0) <= len(data) <= schema.get("maxItems", len(data)):
            yield f"{where}: {len(data)} items"
        for k, item in enumerate(data):
            part = schema["items"]
            yield from find_faults(item, part[k] if isinstance(part, list) else part, f"{where}[{k}]")
    elif isinstance(data, str):
        if not re.search(schema.get("pattern", ""), data) or len(data) > schema.get("maxLength", len(data)):
            yield f"{where}: {data!r}"
    elif isinstance(data, int | float) and not schema.get("minimum", data) <= data <= schema.get(
        "maximum", data
    ):
        yield f"{where}: {data}"


@pytest.mark.parametrize("name", list_problems())
def test_the_schema_takes_every_problem_as_written_and_as_run(name: str) -> None:
    path = Path(sys.modules[load_problem.__module__].__file__ or "").parent / f"{name}.toml"
    for text in (path.read_text(encoding="utf-8"), load_problem(name).as_toml()):
        assert not list(find_faults(tomllib.loads(text), build_schema()))


WRONG = {
    "seed": -1,
    "scene": "two_fingers",
    "name": "a b",
    "summary": 3,
    "obejct": {},
    "object": {"radius_m": 0},
    "friction": {"sliding": "0.5"},
    "hand": {"tip_radii_m": [0.018, 0.018, 2]},
    "start": {"contacts_deg": [[0, 91], [1, 1], "free"]},
    "goal": {"kind": "juggle"},
    "control": {"rate_hz": 300},
    "gait": {"node_budget": 0},
    "forces": {"normal_N": 1000},
    "margins": {"cone_share": 1},
    "obstacles": [{"kind": "box", "pos_m": [0, 0], "size_m": [1, 1, 1]}],
    "acceptance": {"replay_matches": 1},
}


@pytest.mark.parametrize("key", WRONG)
def test_the_schema_refuses_what_reading_refuses(key: str) -> None:
    data = {"format": 1, "goal": {"rotation": {"axis": [0, 0, 1], "angle_deg": 90}}, key: WRONG[key]}
    assert list(find_faults(data, build_schema()))
    with pytest.raises(ProblemError):
        build_problem(data)


# -- commands ------------------------------------------------------------------------------------------------------


def test_new_writes_a_file_that_plan_reads(cwd: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "mine.toml"]) == 0
    assert capsys.readouterr().out.startswith("mine.toml: ")
    assert load_problem("mine.toml").name == "mine"
    assert "`dexplan plan mine.toml`" in (cwd / "mine.toml").read_text()
    before = (cwd / "mine.toml").read_bytes()
    assert main(["new", "mine.toml"]) == 2
    assert (cwd / "mine.toml").read_bytes() == before


def test_new_does_not_write_through_a_link_that_leads_nowhere(cwd: Path) -> None:
    (cwd / "mine.toml").symlink_to(cwd / "elsewhere.toml")
    assert main(["new", "mine.toml"]) == 2
    assert not (cwd / "elsewhere.toml").exists()


def test_new_leaves_nothing_where_the_disk_is_full(
    cwd: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Full:
        def __enter__(self) -> Full:
            return self

        def __exit__(self, *error: object) -> None: ...

        def write(self, text: str) -> None:
            raise OSError(28, "No space left on device")

    def open_(self: Path, *given: object, **options: object) -> Full:
        self.touch()
        return Full()

    monkeypatch.setattr(Path, "open", open_)
    assert main(["new", "mine.toml"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(cwd.iterdir())


def test_schema_is_printed_or_written(cwd: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert capsys.readouterr().out == build_schema_text()
    assert main(["schema", SCHEMA_FILE]) == 0
    assert (cwd / SCHEMA_FILE).read_text() == build_schema_text()
    # An older one of ours makes room.
    (cwd / SCHEMA_FILE).write_text(build_schema_text().replace("radius of the ball", "older words"))
    assert main(["schema", SCHEMA_FILE]) == 0
    assert (cwd / SCHEMA_FILE).read_text() == build_schema_text()


@pytest.mark.parametrize("name", list_problems())
def test_show_prints_a_file_that_says_the_same(
    name: str, cwd: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["show", name]) == 0
    text = capsys.readouterr().out
    (cwd / "shown.toml").write_text(text)
    assert load_problem("shown.toml") == load_problem(name)
    assert text.startswith(f"# problem         {name}")


def test_show_takes_set_and_seed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "any_attitude", "--seed", "5", "--set", "friction.safety=1.5"]) == 0
    problem = build_problem(tomllib.loads(capsys.readouterr().out))
    assert (problem.seed, problem.friction.safety) == (5, 1.5)
    assert problem == load_problem("any_attitude", {"seed": 5, "friction.safety": 1.5})


def test_words_tell_what_is_asked() -> None:
    changes = {"goal.translation_m": [0.01, 0.0, -0.002], "acceptance.position_error_max_mm": 0.7}
    words = spell_problem(load_problem("shelf", changes))
    assert "shift the object by (10, 0, -2) mm in the world" in words
    assert "limits looser than default: position_error_max_mm 0.7 instead of 0.5" in words
    assert "obstacles" in words
    point = {"point_m": [0.035, 0.0, 0.0]}
    told = spell_problem(load_problem("hold_two", {"start.contacts_deg": [point, [180, 0], "free"]}))
    assert "finger 1 at (35.0, 0.0, 0.0) mm; finger 2 at azimuth 180, elevation 0 deg; finger 3 free" in told
