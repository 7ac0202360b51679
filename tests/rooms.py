"""The rooms of the package and what each may import: read by ``test_layers.py``, which enforces the table, and by
``scripts/architecture``, which writes it into ``docs/architecture.md``.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "dexplan"
FIRST_MARK, LAST_MARK = "<!-- rooms: written by scripts/architecture -->", "<!-- end of rooms -->"
"""What the table stands between in ``docs/architecture.md``."""


@dataclass(frozen=True)
class Room:
    """What one room may import: rooms of this package by their dotted names, and third-party packages.

    A room named without a dot stands for all of its sub-rooms.
    """

    rooms: frozenset[str]
    third_party: frozenset[str] = frozenset()


def _see(names: str, third_party: str = "") -> Room:
    return Room(frozenset(names.split()), frozenset(third_party.split()))


GROUND = "errors spatial brief notebook icosphere moved"
MATH = "numpy scipy"
ALL = (
    f"{GROUND} contact grasp kinematics plans scene planning control sim testing models viz witness problems cli commands "
    "arguments builders pipeline pool run_folder terminal usage __init__"
)
KNOWN = f"{GROUND} contact grasp kinematics plans scene"
PROBLEMS = (
    "planning.admissible planning.ways planning.regions planning.rolling planning.contacts planning.search"
)
ROOMS = {
    # storey 0
    "errors": _see(""),
    "spatial": _see("errors", MATH),
    "moved": _see(""),
    "brief": _see("", MATH),
    "notebook": _see(""),
    "icosphere": _see("brief spatial", MATH),
    # storey 1
    "contact": _see(f"{GROUND}", MATH),
    "contact.surfaces": _see(f"{GROUND}", MATH),
    "contact.bodies": _see(GROUND, MATH),
    "contact.kinematics": _see(f"{GROUND} contact contact.surfaces", MATH),
    "contact.rolling": _see(f"{GROUND} contact contact.surfaces contact.kinematics", MATH),
    "grasp": _see(f"{GROUND} contact", MATH),
    "grasp.closed_forms": _see(f"{GROUND} contact grasp", MATH),
    "grasp.force": _see(f"{GROUND} contact grasp", f"{MATH} osqp daqp"),
    "kinematics": _see(f"{GROUND} contact", f"{MATH} platformdirs"),
    # storey 2
    "models": _see(""),
    "plans": _see(f"{GROUND} contact grasp kinematics", MATH),
    "scene": _see(f"{GROUND} contact grasp kinematics models", f"{MATH} mujoco dm_control"),
    # storey 3
    "planning": _see(KNOWN, MATH),
    "planning.admissible": _see(KNOWN, MATH),
    "planning.ways": _see(f"{KNOWN} planning.admissible", f"{MATH} ompl"),
    "planning.regions": _see(f"{KNOWN} planning.admissible", MATH),
    "planning.rolling": _see(f"{KNOWN} planning.admissible", MATH),
    "planning.contacts": _see(f"{KNOWN} planning.admissible planning.ways planning.regions", MATH),
    "planning.search": _see(f"{KNOWN} planning.ways planning.contacts", MATH),
    "planning.gait": _see(f"{KNOWN} {PROBLEMS}", MATH),
    "planning.regrasp": _see(f"{KNOWN} {PROBLEMS}", MATH),
    "planning.actions": _see(f"{KNOWN} {PROBLEMS} planning.gait planning.regrasp", MATH),
    "planning.tasks": _see(f"{KNOWN} planning", MATH),
    "control": _see(KNOWN, f"{MATH} mujoco mink daqp"),
    # storey 4
    "sim": _see(GROUND, f"{MATH} mujoco"),
    "sim.record": _see(f"{KNOWN} control sim", f"{MATH} mujoco"),
    "sim.judge": _see(f"{GROUND} sim", f"{MATH} mujoco osqp"),
    "testing": _see(f"{GROUND} sim.judge", f"{MATH} mujoco pytest"),
    # storey 5
    "viz": _see(ALL, f"{MATH} mujoco matplotlib mpl_toolkits jinja2 imageio_ffmpeg viser tqdm"),
    "witness": _see(ALL, f"{MATH} mujoco matplotlib tqdm clarabel"),
    "problems": _see(ALL, f"{MATH} msgspec tomli_w"),
    "run_folder": _see(f"{GROUND} problems", "tomli_w"),
    "pool": _see(""),
    "terminal": _see(GROUND),
    "usage": _see(GROUND, "tyro"),
    "cli": _see(ALL, "tyro"),
    "arguments": _see(ALL, "tyro"),
    "commands": _see(ALL, "tqdm platformdirs"),
    "pipeline": _see(ALL, MATH),
    "builders": _see(f"{KNOWN} planning control problems", MATH),
    "__init__": _see(ALL),
    "__main__": _see("cli"),
}
"""Every room, floor by floor: what stands below may not import what stands above."""
WITH_FLOORS = {"contact", "grasp", "planning", "sim"}
"""Rooms that have sub-rooms."""


def read_sentence(room: str) -> str:
    """Return what a room says of itself: the first line of its ``__init__``, or of the module."""
    place = PACKAGE / room.replace(".", "/")
    file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    if room == "models":
        return "MJCF files, every element named; they stand at the top of the repository."
    return (
        (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "")
        .split("\n\n")[0]
        .replace("\n", " ")
    )


def _spell_rooms(room: Room) -> str:
    """Return which rooms one may import, short: what stands below everything as *ground*."""
    if set(ALL.split()) <= room.rooms:
        return "all"
    ground = set(GROUND.split())
    others = [f"`{name}`" for name in ROOMS if name in room.rooms - ground]
    below = [f"`{name}`" for name in GROUND.split() if name in room.rooms]
    return ", ".join((["*ground*"] if ground <= room.rooms else below) + others) or "–"


def describe_rooms() -> str:
    """Return the table of rooms as Markdown, as it stands in ``docs/architecture.md``."""
    ground = ", ".join(f"`{name}`" for name in GROUND.split())
    lines = [
        f"*Ground* stands for {ground}; a room with sub-rooms stands for all of them.",
        "",
        "| room | what it answers | may import | third-party |",
        "| --- | --- | --- | --- |",
    ]
    for name, room in ROOMS.items():
        packages = ", ".join(sorted(room.third_party)) or "–"
        sentence = read_sentence(name).replace("|", "\\|")
        lines.append(f"| `{name}` | {sentence} | {_spell_rooms(room)} | {packages} |")
    return "\n".join(lines) + "\n"


def rewrite(page: str) -> str:
    """Return the text of ``docs/architecture.md`` with the table of rooms as it is now."""
    before, _, rest = page.partition(FIRST_MARK)
    _, _, after = rest.partition(LAST_MARK)
    return f"{before}{FIRST_MARK}\n{describe_rooms()}{LAST_MARK}{after}"
