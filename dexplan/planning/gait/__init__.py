"""Turn and shift the object by exchanging the fingers that hold it: finger substitution and finger rewind.

===============  ==============================================================================
``routes``       the ways that an object may take to its goal, as legs
``exchange``     can fingers be exchanged?
``search``       ``GaitSearch``: which finger lifts, where it lands, how far the object goes
``escape``       where a pair takes the object first, if no other finger finds room beside it
``theorem_1``    the paper's necessary condition for a gait
``steps``        what a search answers with
===============  ==============================================================================

Station, orbit, leg and hover are explained, with pictures, in ``docs/glossary.md``.
"""

__all__ = ["escape", "exchange", "routes", "search", "start_pairs", "steps", "theorem_1"]
