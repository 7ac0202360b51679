"""Replays a recorded run and judges it: sees numpy, scipy, OSQP and MuJoCo, and of dexplan only the record.

=========================  ==================================================================================
``validate``               ``validate_run``: all checks, one ``ValidationReport``
``replay``                 ``replay``: the record stepped again, and what every sample shows
``limits``                 the limits of the checks (``limits.toml``): which may be set, which way is looser
``groups``                 checks in groups: physics, task, contacts, forces, internals
``world``                  what is known of a model, by name
``force_audit``            could any contact forces give the object what it should get?
=========================  ==================================================================================

How to add a check: ``docs/architecture.md``.

>>> from dexplan.sim.judge.limits import load_default_limits
>>> load_default_limits()["friction_utilisation_max"]
0.9
"""

__all__ = [
    "force_audit",
    "force_audit_questions",
    "force_audit_values",
    "groups",
    "limits",
    "replay",
    "true_world",
    "validate",
    "world",
]
