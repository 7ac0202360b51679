"""The storeys of the house: who may import whom, and where the world may be stepped. Parsed, not executed."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from rooms import ROOMS, WITH_FLOORS

PACKAGE = Path(__file__).resolve().parents[1] / "dexplan"
LINE_LIMIT, CLASS_LIMIT = 350, 200
LONG_FILES: set[str] = set()
"""Files beyond the limit, none longer than 400 lines.  This list only shrinks."""
LONG_CLASSES: set[str] = set()
"""Classes beyond the limit.  This list only shrinks."""
BANNED_NAMES = {"utils", "util", "common", "helpers", "helper", "manager", "managers", "misc"}
STEPPING_FILES = {
    "sim/record/rollout.py",
    "sim/judge/replay.py",
    "testing/stepping.py",  # foreign scenes, which neither our rollout nor our replay can run
}
MOST_FLOORS = 7
"""Floors of rooms in ``planning`` at most: states, ways, contacts, the engine, what is asked of it, actions, tasks."""
KNOWN_CIRCLES: frozenset[frozenset[str]] = frozenset()
"""Files that import one another.  This list only shrinks."""

FILES = sorted(PACKAGE.rglob("*.py"))


def _name(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def _room(path: Path) -> str:
    parts = path.relative_to(PACKAGE).parts
    if parts[0] in WITH_FLOORS and len(parts) > 2:
        return ".".join(parts[:2])
    return parts[0].removesuffix(".py")


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


def _imported_files(path: Path) -> Iterator[tuple[Path, int]]:
    """Yield the files of this package that a file imports, wherever it does so."""
    for name, line in _imports(path):
        target = _module_of(name) if name.split(".")[0] == "dexplan" else None
        if target is not None and target != path:
            yield target, line


@pytest.mark.parametrize("path", FILES, ids=_name)
def test_imports_stay_within_what_the_room_may_see(path: Path) -> None:
    room = _room(path)
    assert room in ROOMS, f"{_name(path)}: a room that the table does not list"
    allowed, wrong = ROOMS[room], []
    for target, line in _imported_files(path):
        other = _room(target)
        if other != room and other not in allowed.rooms and other.split(".")[0] not in allowed.rooms:
            wrong.append(f"line {line}: {_name(target)}")
    for name, line in _imports(path):
        package = name.split(".")[0]
        if package != "dexplan" and package not in sys.stdlib_module_names | allowed.third_party:
            wrong.append(f"line {line}: {name}")
    assert not wrong, f"{_name(path)} may not import: {'; '.join(wrong)}"


def _doors(room: str) -> set[str]:
    """Return what the ``__init__`` of a room lets others import: the modules in its ``__all__``."""
    text = (PACKAGE / room.replace(".", "/") / "__init__.py").read_text(encoding="utf-8")
    assigned = (node for node in ast.parse(text).body if isinstance(node, ast.Assign))
    return next(set(ast.literal_eval(n.value)) for n in assigned if ast.unparse(n.targets[0]) == "__all__")


@pytest.mark.parametrize("path", FILES, ids=_name)
def test_rooms_are_entered_by_their_doors(path: Path) -> None:
    """What is not in the ``__all__`` of a room is nobody else's business."""
    wrong = []
    for target, line in _imported_files(path):
        room = _room(target)
        is_inside = _room(path) == room or target.parent == PACKAGE or target.name == "__init__.py"
        if not is_inside and target.stem not in _doors(room):
            wrong.append(f"line {line}: {_name(target)}")
    assert not wrong, f"{_name(path)} goes through walls: {'; '.join(wrong)}"


def _find_circles(arrows: dict[str, set[str]]) -> set[frozenset[str]]:
    """Return the strongly connected sets of more than one node."""

    def reach(start: str) -> set[str]:
        seen, todo = set(), [start]
        while todo:
            for following in arrows.get(todo.pop(), set()) - seen:
                seen.add(following)
                todo.append(following)
        return seen

    reached = {node: reach(node) for node in arrows}
    circles = {
        frozenset(other for other in reached[node] if node in reached.get(other, set()))
        for node in arrows
        if node in reached[node]
    }
    return {circle for circle in circles if len(circle) > 1}


def _arrows() -> tuple[dict[str, set[str]], dict[str, set[str]]]:
    """Return who imports whom: files, and rooms."""
    files: dict[str, set[str]] = {}
    rooms: dict[str, set[str]] = {}
    for path in FILES:
        targets = {target for target, _ in _imported_files(path)}
        files[_name(path)] = {_name(target) for target in targets}
        rooms.setdefault(_room(path), set()).update({_room(t) for t in targets} - {_room(path)})
    return files, rooms


def test_there_are_no_circles() -> None:
    files, rooms = _arrows()
    assert not _find_circles(rooms)
    assert _find_circles(files) == set(KNOWN_CIRCLES)


def test_planning_has_few_floors() -> None:
    _, rooms = _arrows()
    arrows = {a: {b for b in found if b.startswith("planning.")} for a, found in rooms.items()}

    def height(room: str) -> int:
        return 1 + max((height(below) for below in arrows[room]), default=0)

    assert max(height(room) for room in arrows if room.startswith("planning.")) <= MOST_FLOORS


@pytest.mark.parametrize("path", [f for f in FILES if _room(f).startswith("planning")], ids=_name)
def test_planning_sees_no_door_to_mujoco(path: Path) -> None:
    """``planning`` may import only those modules of ``scene`` that do not import MuJoCo."""
    for name, line in _imports(path):
        target = _module_of(name) if name.startswith("dexplan.scene") else None
        if target is not None:
            doors = {n.split(".")[0] for n, _ in _imports(target)} & {"mujoco", "dm_control"}
            assert not doors, f"{_name(path)} line {line}: {name} imports {doors}"


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
def test_only_these_files_step_the_world(path: Path) -> None:
    lines = _stepping_lines(ast.parse(path.read_text(encoding="utf-8")))
    if _name(path) not in STEPPING_FILES:
        assert not lines, f"{_name(path)} steps the world in lines {lines}"


@pytest.mark.parametrize("path", FILES, ids=_name)
def test_names_and_lengths(path: Path) -> None:
    parts = {part.removesuffix(".py") for part in path.relative_to(PACKAGE).parts}
    assert not parts & BANNED_NAMES, f"{_name(path)}: a name that says nothing"
    count = len(path.read_text(encoding="utf-8").splitlines())
    assert count <= (400 if _name(path) in LONG_FILES else LINE_LIMIT), (
        f"{_name(path)} has {count} lines; split it"
    )


def test_what_is_too_long_is_listed_and_nothing_else() -> None:
    long_files = {_name(f) for f in FILES if len(f.read_text(encoding="utf-8").splitlines()) > LINE_LIMIT}
    long_classes = {
        node.name
        for file in FILES
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef) and (node.end_lineno or 0) - node.lineno > CLASS_LIMIT
    }
    assert long_files == LONG_FILES
    assert long_classes == LONG_CLASSES


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


@pytest.mark.parametrize("room", ["contact", "grasp", "kinematics", "plans", "planning"])
def test_theory_does_not_load_mujoco(room: str) -> None:
    files = [f for f in FILES if _room(f).split(".")[0] == room]
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


def test_no_room_hides_a_public_name() -> None:
    """A module ``dexplan.x``, once imported, replaces whatever else ``dexplan.x`` was: verbs are no names for rooms."""
    modules = {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in FILES}
    import dexplan

    assert not set(dexplan.__all__) & modules
