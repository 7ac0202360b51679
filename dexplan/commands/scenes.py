"""What is asked about a machine, or about the contacts of any MuJoCo scene."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from dexplan.commands.asked import CONFIRMED, HONEST_NO
from dexplan.errors import ProblemError, UnknownNameError

if TYPE_CHECKING:
    from dexplan.testing.scene_run import SceneRun


def check_machine(is_bare: bool) -> int:
    """Say in one line each whether this machine has what dexplan needs; ``is_bare``: no option of a scene was given."""
    if not is_bare:
        raise ProblemError("doctor", "", "SCENE is missing", "accepted: dexplan doctor SCENE, an MJCF file")
    from platformdirs import user_cache_dir

    from dexplan.testing.environment import check_environment

    cache = Path(os.environ.get("DEXPLAN_CACHE") or user_cache_dir("dexplan"))
    findings = check_environment(cache, Path.cwd())
    for finding in findings:
        print(finding)
    return CONFIRMED if all(finding.is_well for finding in findings) else HONEST_NO


def doctor(run: SceneRun, with_trials: bool) -> int:
    """Run any MuJoCo scene, say what became of its contacts and why; the last line is the verdict."""
    from dexplan.testing.doctor import diagnose

    diagnosis = diagnose(run, with_trials=with_trials)
    print(diagnosis)
    return CONFIRMED if diagnosis.is_well else HONEST_NO


def stability(action: str, run: SceneRun, folder: Path, name: str | None, junit: Path | None) -> int:
    """Record how contacts behave, or check it; the last line is the verdict."""
    if action not in {"record", "check"}:
        raise UnknownNameError("action", action, ["record", "check"])
    from dexplan.testing import stability as contacts

    if action == "record":
        print(contacts.record(run, name, folder))
        return CONFIRMED
    checked = contacts.check(run, name, folder)
    print(checked.table())
    if junit is not None:
        checked.save_junit(junit)
    print(f"{'PASS' if checked.is_passed else 'FAIL'} {checked.name}")
    return CONFIRMED if checked.is_passed else HONEST_NO
