"""The storeys of the house: who may import whom, and where the world may be stepped. Parsed, not executed."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "dexplan"
LINE_LIMIT = 400
BANNED_NAMES = {"utils", "util", "common", "helpers", "helper", "manager", "managers", "misc"}
STEPPING_FILES = {"sim/rollout.py", "sim/replay.py"}

GROUND = {"errors", "spatial", "brief"}
MATH = {"numpy", "scipy"}
OUTSIDE = {
    "viz",
    "witness",
    "problems",
    "cli",
    "commands",
    "pipeline",
    "run_folder",
    "terminal",
    "usage",
    "__init__",
    "__main__",
}
INNER = {"contact", "grasp", "scene", "planning", "control", "sim", "models"}


@dataclass(frozen=True)
class Storey:
    """What one room may import: rooms of this package, and third-party packages."""

    rooms: set[str]
    third_party: set[str]


STOREYS = {
    "errors": Storey(set(), set()),
    "spatial": Storey({"errors"}, MATH),
    "brief": Storey(set(), MATH),
    "contact": Storey(GROUND, MATH),
    "grasp": Storey(GROUND | {"contact"}, MATH | {"osqp", "daqp"}),
    "models": Storey(set(), set()),
    "scene": Storey(GROUND | {"contact", "grasp", "models"}, MATH | {"mujoco", "dm_control", "platformdirs"}),
    "planning": Storey(GROUND | {"contact", "grasp", "scene"}, MATH | {"ompl"}),
    "control": Storey(GROUND | {"contact", "grasp", "scene", "planning"}, MATH | {"mujoco", "mink", "daqp"}),
    "sim": Storey(GROUND | (INNER - {"models"}), MATH | {"mujoco"}),
    "viz": Storey(
        GROUND | INNER | OUTSIDE,
        MATH | {"mujoco", "matplotlib", "mpl_toolkits", "jinja2", "imageio_ffmpeg", "viser", "tqdm"},
    ),
    "witness": Storey(GROUND | INNER | OUTSIDE, MATH | {"mujoco", "matplotlib", "tqdm", "clarabel"}),
    "problems": Storey(GROUND | INNER | OUTSIDE, MATH | {"msgspec", "tomli_w"}),
    "run_folder": Storey(GROUND | {"problems"}, {"tomli_w"}),
    "terminal": Storey(GROUND, set()),
    "usage": Storey(GROUND, {"tyro"}),
    "cli": Storey(GROUND | INNER | OUTSIDE, {"tyro"}),
    "commands": Storey(GROUND | INNER | OUTSIDE, {"tqdm"}),
    "pipeline": Storey(GROUND | INNER | OUTSIDE, MATH | {"mujoco", "tqdm", "platformdirs"}),
    "__init__": Storey(GROUND | INNER | OUTSIDE, set()),
    "__main__": Storey({"cli"}, set()),
}

JUDGE_THIRD_PARTY = {"osqp"}
"""What the judge's files in ``sim`` may import besides, and the ones that carry the controller may not."""

JUDGE_SEES_NOT = {"planning", "control", "contact", "grasp"}
"""Rooms closed to every file of ``sim`` but the ones that carry the controller."""

FILES = sorted(PACKAGE.rglob("*.py"))


def _name(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def _room(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def _imports(path: Path) -> Iterator[tuple[str, int]]:
    """Yield (absolute dotted name, line) of everything a file imports, wherever it does so.

    ``from a import b`` yields ``a.b``: b may be a module.
    """
    package = ["dexplan", *path.relative_to(PACKAGE).parts[:-1]]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                yield f"{module}.{alias.name}", node.lineno


def _module_of(name: str) -> Path | None:
    """Return the file of the longest prefix of an absolute dexplan name that is a module."""
    parts = name.split(".")[1:]
    for count in range(len(parts), 0, -1):
        place = PACKAGE.joinpath(*parts[:count])
        for file in (place.with_suffix(".py"), place / "__init__.py"):
            if file.is_file():
                return file
    return None


def _is_carrier(path: Path) -> bool:
    """Whether a file of ``sim`` runs the controller (and so is no judge)."""
    return path.stem.startswith("rollout")


@pytest.mark.parametrize("path", FILES, ids=_name)
def test_imports_stay_on_their_storey(path: Path) -> None:
    room = _room(path)
    assert room in STOREYS, f"{_name(path)}: a room that no storey lists"
    storey, wrong = STOREYS[room], []
    is_judge = room == "sim" and not _is_carrier(path)
    third_party = storey.third_party | (JUDGE_THIRD_PARTY if is_judge else set())
    for name, line in _imports(path):
        parts = name.split(".")
        if parts[0] == "dexplan":
            # `from dexplan import name` names a room, or a public value that lives in one.
            target = parts[1] if len(parts) > 1 else "__init__"
            target = target if target in STOREYS else "__init__"
            allowed = target == room or target in storey.rooms
        else:
            allowed = parts[0] in sys.stdlib_module_names or parts[0] in third_party
        if not allowed:
            wrong.append(f"line {line}: {name}")
    assert not wrong, f"{_name(path)} may not import: {'; '.join(wrong)}"


@pytest.mark.parametrize("path", [f for f in FILES if _room(f) == "planning"], ids=_name)
def test_planning_sees_no_door_to_mujoco(path: Path) -> None:
    """``planning`` may import only those modules of ``scene`` that do not import MuJoCo."""
    for name, line in _imports(path):
        target = _module_of(name) if name.startswith("dexplan.scene") else None
        if target is not None:
            doors = {n.split(".")[0] for n, _ in _imports(target)} & {"mujoco", "dm_control"}
            assert not doors, f"{_name(path)} line {line}: {name} imports {doors}"


@pytest.mark.parametrize("path", [f for f in FILES if _room(f) == "sim" and not _is_carrier(f)], ids=_name)
def test_judge_shares_no_code_with_the_judged(path: Path) -> None:
    for name, line in _imports(path):
        parts = name.split(".")
        if parts[0] == "dexplan" and len(parts) > 1:
            assert parts[1] not in JUDGE_SEES_NOT, f"{_name(path)} line {line}: {name}"
            target = _module_of(name)
            is_carried = target is not None and _room(target) == "sim" and _is_carrier(target)
            assert not is_carried, f"{_name(path)} line {line}: {name}"


def _stepping_lines(tree: ast.Module) -> list[int]:
    """Return the lines that name a stepping function of MuJoCo: as attribute, name, import, or string for
    getattr.
    """
    lines = []
    for node in ast.walk(tree):
        text = {
            ast.Attribute: lambda n: n.attr,
            ast.Name: lambda n: n.id,
            ast.alias: lambda n: n.name.rsplit(".", 1)[-1],
            ast.Constant: lambda n: n.value if isinstance(n.value, str) else "",
        }.get(type(node), lambda n: "")(node)
        is_rollout = (
            isinstance(node, ast.Attribute)
            and node.attr in {"rollout", "batch"}
            and isinstance(node.value, ast.Name)
            and node.value.id in {"mujoco", "mj"}
        )
        if is_rollout or (text.startswith("mj_step") and text.isidentifier()):
            lines.append(node.lineno)
    return lines


@pytest.mark.parametrize("path", FILES, ids=_name)
def test_only_two_files_step_the_world(path: Path) -> None:
    lines = _stepping_lines(ast.parse(path.read_text(encoding="utf-8")))
    if _name(path) not in STEPPING_FILES:
        assert not lines, f"{_name(path)} steps the world in lines {lines}"


@pytest.mark.parametrize("path", FILES, ids=_name)
def test_names_and_lengths(path: Path) -> None:
    parts = {part.removesuffix(".py") for part in path.relative_to(PACKAGE).parts}
    assert not parts & BANNED_NAMES, f"{_name(path)}: a name that says nothing"
    count = len(path.read_text(encoding="utf-8").splitlines())
    assert count <= LINE_LIMIT, f"{_name(path)} has {count} lines; split it"


def test_the_checker_finds_what_it_looks_for() -> None:
    """A guard that never fires is none: the step finder sees each way of writing a step."""
    for text in (
        "mujoco.mj_step(m, d)",
        "from mujoco import mj_step1 as s",
        "getattr(mujoco, 'mj_step')",
        "import mujoco\nmujoco.rollout.rollout(m, d)",
    ):
        assert _stepping_lines(ast.parse(text)), text
    assert not _stepping_lines(ast.parse("'''mj_step is not for you.'''\n# mj_step\nmujoco.mj_forward(m, d)"))


def _loaded_after(modules: list[str]) -> set[str]:
    """Return the top-level packages loaded in a fresh interpreter after importing ``modules``."""
    code = "import sys, importlib\n" + "".join(f"importlib.import_module({m!r})\n" for m in modules)
    code += "print(' '.join({m.split('.')[0] for m in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=PACKAGE.parent)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


@pytest.mark.parametrize("room", ["contact", "grasp", "planning"])
def test_theory_does_not_load_mujoco(room: str) -> None:
    files = [f for f in FILES if _room(f) == room]
    modules = [".".join(["dexplan", *f.relative_to(PACKAGE).with_suffix("").parts]) for f in files]
    loaded = _loaded_after([m.removesuffix(".__init__") for m in modules])
    assert not loaded & {"mujoco", "dm_control", "mink"}


def test_import_dexplan_is_light() -> None:
    assert not _loaded_after(["dexplan"]) & {
        "mujoco",
        "matplotlib",
        "scipy",
        "numpy",
        "tyro",
        "dm_control",
        "mink",
    }
    heavy = {"mujoco", "matplotlib", "dm_control", "mink"}
    assert not _loaded_after(["dexplan.cli", "dexplan.problems.read"]) & heavy
