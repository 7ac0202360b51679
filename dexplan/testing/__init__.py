"""Contact verdicts and stability regression for any MuJoCo scene.

The names load when they are first used, so that the pytest plugin costs nothing where nobody asks for its fixture.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dexplan.testing.measurement import Measurement
    from dexplan.testing.recorder import ContactRecorder
    from dexplan.testing.stepping import measure_contacts
    from dexplan.testing.verdict import Judgement, Kind, VerdictOptions, judge_contacts

__all__ = [
    "ContactRecorder",
    "Judgement",
    "Kind",
    "Measurement",
    "VerdictOptions",
    "judge_contacts",
    "measure_contacts",
]

_HOMES = {
    "ContactRecorder": "dexplan.testing.recorder",
    "Judgement": "dexplan.testing.verdict",
    "Kind": "dexplan.testing.verdict",
    "Measurement": "dexplan.testing.measurement",
    "VerdictOptions": "dexplan.testing.verdict",
    "judge_contacts": "dexplan.testing.verdict",
    "measure_contacts": "dexplan.testing.stepping",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'dexplan.testing' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
