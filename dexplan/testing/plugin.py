"""The pytest plugin: the fixture ``contact_baseline`` and its options.  Nothing heavy loads until the fixture is used.

::

    def test_pinch(contact_baseline):
        measured = measure_contacts(model, "pressed", controls, tips=["left", "right"], object="cube")
        contact_baseline.check("pinch", measured)

``pytest --contact-baseline-update`` measures anew and writes the files, by default into ``contact_baselines`` beside the test.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from dexplan.testing.quantities import Measured

FOLDER = "contact_baselines"


class ContactDriftWarning(UserWarning):
    """Contacts moved, but under another version of MuJoCo than that of the baseline."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options and the setting of the plugin."""
    group = parser.getgroup("dexplan", "contact stability (dexplan)")
    group.addoption(
        "--contact-baseline-update",
        action="store_true",
        help="measure contacts anew and write their baselines",
    )
    group.addoption("--contact-baseline-dir", metavar="DIR", help="where the baselines of contacts are")
    parser.addini("contact_baseline_dir", f"folder of contact baselines (default: {FOLDER} beside the test)")


class ContactBaseline:
    """Compares measured contacts with their stored baseline, or writes it; what the fixture of that name returns."""

    def __init__(self, folder: Path, is_updating: bool) -> None:
        self.folder, self.is_updating = folder, is_updating

    def check(self, name: str, measured: Measured) -> None:
        """Fail where ``measured`` has drifted from the baseline ``name``, with a table of how far.

        ``measured`` is what ``measure_contacts`` or a ``ContactRecorder`` returned, or named numbers of your own.  Under
        another version of MuJoCo than the baseline's a changed verdict fails, and changed numbers warn.
        """
        __tracebackhide__ = True
        from dexplan.errors import DexplanError
        from dexplan.testing.baseline import Baseline, compare, find_baseline, name_file
        from dexplan.testing.quantities import describe_run

        try:
            now = describe_run(name, measured)
            installed = now.versions["mujoco"]
            if self.is_updating:
                now.save(self.folder / name_file(name, installed))
                return
            found = find_baseline(self.folder, name, installed)
            if found is None:
                pytest.fail(
                    f"no baseline {name!r} in {self.folder}; pytest --contact-baseline-update writes it",
                    pytrace=False,
                )
            path, is_own = found
            drift = compare(Baseline.load(path), now, path.name, is_same_version=is_own)
        except DexplanError as error:
            pytest.fail(str(error), pytrace=False)
        if not drift.is_within:
            pytest.fail(f"contacts have drifted: {drift.table()}", pytrace=False)
        if drift.has_moved:
            warnings.warn(ContactDriftWarning(drift.table()), stacklevel=2)


@pytest.fixture
def contact_baseline(request: pytest.FixtureRequest) -> ContactBaseline:
    """Compare contacts with a stored baseline: ``contact_baseline.check("pinch", measured)``."""
    config = request.config
    asked = config.getoption("--contact-baseline-dir")
    stated = str(config.getini("contact_baseline_dir"))
    if asked:
        folder = config.invocation_params.dir / asked
    elif stated:
        folder = config.rootpath / stated
    else:
        folder = request.path.parent / FOLDER
    return ContactBaseline(folder, bool(config.getoption("--contact-baseline-update")))
