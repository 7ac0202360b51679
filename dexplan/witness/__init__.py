"""The physics as witness: experiments about the paper's theorems, and about what we claim of ourselves.

================  ===========================================================================================
``experiments``   theorems as boundaries that MuJoCo obeys, through the whole hand: ``scripts/phase_diagram``
``lifted``        one finger lifted from a grasp of three: hold, spin or drop
``rolling``       rolls and rolling triangles in every heading: ``scripts/rolling_sweep``
``rolling_hand``  three joints per finger: a ball turned on contacts that roll
``three_to_two``  from three fingers to two by rolling
``attitudes``     random attitudes from random starts, planned and carried out
``adjustments``   random goal grasps; ``shifts``: random shifts
``confirmation``  built-in problems and random worlds: planned, carried out, judged
``bodies``        random attitudes of any convex body, and what brute force says of refusals
``brute_force``   a refusal held against a grid of contacts, of a ball; of any body: ``pair_search`` over a ``grasp_grid``
``endurance``     goal after goal in one rollout; ``endurance_picture``: told and drawn
``digests``       fingerprints of plans
================  ===========================================================================================

``scripts/`` has a script for each; nothing of the package needs this room.

>>> from dexplan.witness.confirmation import list_builtin_cases
>>> sum(1 for _ in list_builtin_cases())
84
"""

__all__ = [
    "adjustments",
    "attitudes",
    "bodies",
    "brute_force",
    "confirmation",
    "digests",
    "endurance",
    "endurance_picture",
    "experiments",
    "force_audit",
    "lifted",
    "report",
    "rolling",
    "rolling_hand",
    "shifts",
    "three_to_two",
]
