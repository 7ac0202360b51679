"""dexplan's own regression of foreign contacts, by what users' fixture is made of.

``pytest tests/testing/test_foreign_stability.py --contact-baseline-update`` writes the files of the installed MuJoCo.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from stability_scenes import SCENES

from dexplan.testing.plugin import FOLDER, ContactBaseline


@pytest.mark.parametrize("name", SCENES)
def test_foreign_contacts_behave_as_they_did(name: str, request: pytest.FixtureRequest) -> None:
    # Not the fixture itself: it comes with an installed package, and this runs without one as well.
    is_updating = bool(request.config.getoption("--contact-baseline-update", default=False))
    ContactBaseline(Path(__file__).parent / FOLDER, is_updating).check(name, SCENES[name]().measure())
