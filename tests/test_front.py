"""The front door of the package: public names are what they say, whatever was imported before."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize(
    "before",
    ["dx.Plan", "import dexplan.plan", "from dexplan.plan.plan import Plan", "dx.load_scene", "dx.plan"],
)
def test_the_verb_plan_is_no_room(before: str) -> None:
    """``dexplan.plan`` the verb and ``dexplan/plan`` the room share a name: importing the room keeps the verb."""
    code = (
        f"import dexplan as dx\n{before}\nfrom dexplan.pipeline import plan\nassert dx.plan is plan, dx.plan"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
