"""Contact verdicts and stability regression for any MuJoCo scene.

====================  ==============================================================================
``measure_contacts``  runs a model under given controls and returns a ``Measurement`` of its contacts
``ContactRecorder``   does that in a loop of your own
``judge_contacts``    what became of each contact: a ``Judgement`` of verdicts, by ``VerdictOptions``
``audit_forces``      could any contact forces have held the object?  A ``ForceReport``, each *no* with its certificate
``Kind``              the words of a verdict, from stuck to lost
``doctor``            ``dexplan doctor``: a scene file, what bites, what cures; ``environment``: this machine
``stability``         ``dexplan stability``: ``quantities`` of a run against a ``baseline``
====================  ==============================================================================

The names load when they are first used, so that the pytest plugin (``plugin``, with the fixture ``contact_baseline``) costs
nothing where nobody asks for it.  ``docs/contacts.md`` shows signs and frames.

A box on a slope of half its friction angle creeps, for MuJoCo's contacts are soft; at one and a half times it slides:

>>> import mujoco, numpy as np
>>> from dexplan.testing import judge_contacts, measure_contacts
>>> def tilt(share):
...     pull = 9.81 * np.sin(np.arctan(0.5 * share)), 9.81 * np.cos(np.arctan(0.5 * share))
...     return mujoco.MjModel.from_xml_string(f'''
...     <mujoco><option cone="elliptic" gravity="{pull[0]} 0 {-pull[1]}"/>
...       <default><geom friction="0.5 0.005 0.0001"/></default>
...       <worldbody><geom name="table" type="plane" size="0 0 1"/>
...         <body name="box" pos="0 0 .02"><freejoint/><geom type="box" size=".05 .05 .02" mass=".1"/></body>
...       </worldbody></mujoco>''')
>>> for share in (0.5, 1.5):
...     measured = measure_contacts(tilt(share), None, np.zeros((300, 0)), object="box")
...     print(judge_contacts(measured).verdicts[0].kind)
creeping
Coulomb slip
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dexplan.testing.forces import ForceReport, audit_forces
    from dexplan.testing.measurement import Measurement
    from dexplan.testing.recorder import ContactRecorder
    from dexplan.testing.stepping import measure_contacts
    from dexplan.testing.verdict import Judgement, Kind, VerdictOptions, judge_contacts

__all__ = [
    "ContactRecorder",
    "ForceReport",
    "Judgement",
    "Kind",
    "Measurement",
    "VerdictOptions",
    "audit_forces",
    "baseline",
    "doctor",
    "environment",
    "judge_contacts",
    "measure_contacts",
    "quantities",
    "scene_run",
    "stability",
]

_HOMES = {
    "ContactRecorder": "dexplan.testing.recorder",
    "ForceReport": "dexplan.testing.forces",
    "Judgement": "dexplan.testing.verdict",
    "Kind": "dexplan.testing.verdict",
    "Measurement": "dexplan.testing.measurement",
    "VerdictOptions": "dexplan.testing.verdict",
    "audit_forces": "dexplan.testing.forces",
    "judge_contacts": "dexplan.testing.verdict",
    "measure_contacts": "dexplan.testing.stepping",
}


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'dexplan.testing' has no attribute {name!r}")
    home = import_module(_HOMES.get(name, f"dexplan.testing.{name}"))
    value = globals()[name] = getattr(home, name) if name in _HOMES else home
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
