"""What happened, and whether it counts: runs recorded, and judged by code that shares nothing with what it judges.

=================  ================================================================================
``record``         ``rollout``: steps the world under the controller
``trace``          ``Trace``: the columns of a run, with the text of its model; ``trace.npz``
``contact_table``  ``Trace.contacts``, column by column
``judge``          ``validate_run``: replays a trace and judges it, check by check
``machine``        what the last bit of a run may depend on
=================  ================================================================================

``mj_step`` stands in two files only: ``record/rollout.py`` and ``judge/replay.py``.

>>> from dexplan.sim.machine import describe_machine
>>> "system" in describe_machine()
True
"""

__all__ = ["contact_table", "judge", "machine", "record", "trace"]
