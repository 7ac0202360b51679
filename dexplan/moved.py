"""Where modules went in 0.2.0: for one release what the documentation named is found under its old name, with a warning.

What counts as named is what README and ``docs/`` of 0.1.0 spelled out.  This module, its table and the three ``__getattr__`` that
use it go in 0.3.0.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

MOVED: Mapping[str, tuple[str, ...]] = {
    "dexplan.contact.coordinates": ("dexplan.contact.kinematics.coordinates",),
    "dexplan.contact.manoeuvre": ("dexplan.contact.rolling.manoeuvre",),
    "dexplan.contact.montana": ("dexplan.contact.kinematics.montana",),
    "dexplan.contact.roll_to": ("dexplan.contact.rolling.roll_to",),
    "dexplan.contact.shapes": ("dexplan.contact.surfaces.shapes",),
    "dexplan.contact.surface": ("dexplan.contact.surfaces.surface",),
    "dexplan.grasp.sphere": ("dexplan.grasp.closed_forms.pair",),
    "dexplan.grasp.triple": ("dexplan.grasp.closed_forms.triple",),
    "dexplan.planning.adjustment": ("dexplan.planning.tasks.grasp_adjustment",),
    "dexplan.planning.configuration_space": ("dexplan.planning.ways.configuration_space",),
    "dexplan.planning.dextrous": ("dexplan.planning.tasks.dextrous_manipulation",),
    "dexplan.planning.escape": ("dexplan.planning.gait.escape",),
    "dexplan.planning.fixed_contacts": ("dexplan.planning.tasks.fixed_contacts",),
    "dexplan.planning.goal": ("dexplan.plans.goal", "dexplan.planning.gait.routes"),
    "dexplan.planning.hand": ("dexplan.planning.admissible.hand",),
    "dexplan.planning.overlap": ("dexplan.planning.actions.overlap",),
    "dexplan.planning.plan": (
        "dexplan.plans.contacts",
        "dexplan.plans.phases",
        "dexplan.plans.actions",
        "dexplan.plans.plan",
    ),
    "dexplan.planning.planner": ("dexplan.planning.tasks.object_manipulation",),
    "dexplan.planning.roll_gait": ("dexplan.planning.rolling.roll_gait",),
    "dexplan.planning.rolling_carry": ("dexplan.planning.rolling.rolling_carry",),
    "dexplan.planning.search": ("dexplan.planning.gait.search",),
    "dexplan.planning.spherical": ("dexplan.planning.regions.spherical",),
    "dexplan.planning.theorems": ("dexplan.planning.regions.theorems",),
    "dexplan.planning.tip_rotation": ("dexplan.planning.admissible.tip_rotation",),
    "dexplan.scene.chain": ("dexplan.kinematics.chain",),
    "dexplan.scene.workspace": ("dexplan.kinematics.workspace",),
    "dexplan.sim.checks_contact": ("dexplan.sim.judge.checks_contact",),
    "dexplan.sim.checks_rolling": ("dexplan.sim.judge.checks_rolling",),
    "dexplan.sim.force_audit": ("dexplan.sim.judge.force_audit",),
    "dexplan.sim.rollout": ("dexplan.sim.record.rollout",),
}
"""Old name of a module: the modules in which its names are looked for now, in this order."""


def forward(old: str, homes: Sequence[str]) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a module ``old`` whose names are in the modules ``homes`` now; each use warns."""

    def find(name: str) -> Any:
        if not name.startswith("__"):
            for home in homes:
                module = import_module(home)
                if hasattr(module, name):
                    text = f"{old}.{name} is {home}.{name} since dexplan 0.2.0; the old name goes in 0.3.0"
                    warnings.warn(text, DeprecationWarning, stacklevel=2)
                    return getattr(module, name)
        raise AttributeError(f"module {old!r} has no attribute {name!r}")

    return find


class _OldModule(Loader):
    """Makes the module that stands under an old name: empty but for its ``__getattr__``."""

    def __init__(self, homes: Sequence[str]) -> None:
        self._homes = homes

    def exec_module(self, module: ModuleType) -> None:
        vars(module)["__getattr__"] = forward(module.__name__, self._homes)


class _Finder(MetaPathFinder):
    """Finds old names; asked last, so that nothing that exists is looked for here."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        homes = MOVED.get(fullname)
        return None if homes is None else ModuleSpec(fullname, _OldModule(homes))


def keep_old_names() -> None:
    """Let the import system find the old names of :data:`MOVED`."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.append(_Finder())
