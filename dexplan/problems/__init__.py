"""Problem files: what they may say, how they are read, and the built-in ones.

==============  ===================================================================================
``problem``     ``Problem`` and its sections, frozen; every key has a default but ``[goal]``
``read``        ``load_problem``: a built-in name or a file, with overrides; ``list_problems``
``rules``       which values are accepted, and what is said of others
``shapes``      the object's shape as a scene takes it
``override``    ``--set KEY=VALUE``
``derived``     values that follow from others
``as_run``      which problem a recorded run was made from
``true_world``  a problem that says how the world truly is, beside the one that is believed
==============  ===================================================================================

>>> from dexplan.problems.read import load_problem
>>> problem = load_problem("hold_two", {"friction.sliding": 0.6})
>>> problem.friction.sliding, problem.object.mass_kg
(0.6, 0.06)
"""

__all__ = [
    "as_run",
    "derived",
    "meanings",
    "override",
    "problem",
    "read",
    "rules",
    "schema",
    "shapes",
    "template",
    "true_world",
    "words",
]
