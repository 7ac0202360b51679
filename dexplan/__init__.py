"""dexplan: dexterous manipulation by rolling and finger gaiting, planned symbolically and proven in MuJoCo.

The public names load when they are first used, so ``import dexplan`` stays light.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from dexplan.moved import keep_old_names

if TYPE_CHECKING:
    from dexplan.control.foreign import RunStart
    from dexplan.control.observation import Observation
    from dexplan.pipeline import inspect, load_run, plan, render, rollout, save_run, validate
    from dexplan.plans.plan import Plan
    from dexplan.problems.problem import Problem
    from dexplan.problems.read import build_problem, load_problem
    from dexplan.scene.library import load_scene
    from dexplan.sim.judge.validate import ValidationReport
    from dexplan.sim.trace import Trace

    __version__: str

__all__ = [
    "Observation",
    "Plan",
    "Problem",
    "RunStart",
    "Trace",
    "ValidationReport",
    "__version__",
    "build_problem",
    "inspect",
    "load_problem",
    "load_run",
    "load_scene",
    "plan",
    "render",
    "rollout",
    "save_run",
    "validate",
]

_HOMES = {
    "Observation": "dexplan.control.observation",
    "RunStart": "dexplan.control.foreign",
    "Plan": "dexplan.plans.plan",
    "Problem": "dexplan.problems.problem",
    "Trace": "dexplan.sim.trace",
    "ValidationReport": "dexplan.sim.judge.validate",
    "build_problem": "dexplan.problems.read",
    "inspect": "dexplan.pipeline",
    "load_problem": "dexplan.problems.read",
    "load_run": "dexplan.pipeline",
    "load_scene": "dexplan.scene.library",
    "plan": "dexplan.pipeline",
    "render": "dexplan.pipeline",
    "rollout": "dexplan.pipeline",
    "save_run": "dexplan.pipeline",
    "validate": "dexplan.pipeline",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        try:
            value: Any = version("dexplan")
        except PackageNotFoundError:
            value = "0+unknown"
    elif name in _HOMES:
        # MuJoCo refuses to load where this names no platform, and says less about it.
        import_module("dexplan.terminal").check_gl_platform()
        value = getattr(import_module(_HOMES[name]), name)
    else:
        raise AttributeError(f"module 'dexplan' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


keep_old_names()
