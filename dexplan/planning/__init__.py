"""What to do: from a goal to a plan.  Never imports MuJoCo; asks the world two questions through a protocol.

=================  =================================================================================
``admissible``     may the hand be in this state?  joints, clearance, forces, torques, order
``ways``           how does a free finger get there?  an arc, or around what is in its way
``regions``        where may a finger touch?  the paper's regions and theorems
``rolling``        a tip that keeps touching while it moves
``contacts``       what can land where, be carried how far, and hold with what: the oracle that a search asks
``search``         one best-first engine over grips and progress
``gait``           turn the object by exchanging the fingers that hold it
``regrasp``        change the contacts while the object rests or is carried
``actions``        from what a search found to the actions of a plan
``tasks``          what a caller asks for, one module per kind of goal
=================  =================================================================================

A room may import only rooms above it in this list, and ``gait`` and ``regrasp`` do not know each other.  Callers seldom come in
here: :func:`dexplan.pipeline.plan` builds hand and goal from a problem file and asks the right task.  "No plan" is a value.

>>> import dexplan as dx
>>> plan = dx.plan(dx.load_problem("hold_two"))
>>> str(plan.status), len(plan.actions)
('solved', 2)
"""

__all__ = [
    "actions",
    "admissible",
    "contacts",
    "gait",
    "regions",
    "regrasp",
    "rolling",
    "search",
    "tasks",
    "ways",
]
