"""``plan.json``: what the schema in docs says, what older files say, and what a plan's file alone is enough for."""

from __future__ import annotations

import copy
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from schema import find_faults

from dexplan import pipeline
from dexplan.errors import DexplanError, RunFolderError
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import RefusalKind
from dexplan.plans.status import Status
from dexplan.problems.read import load_problem
from dexplan.sim.judge.validate import validate_run
from dexplan.witness.digests import as_compared

HERE = Path(__file__).parent
SCHEMA = json.loads((HERE.parents[1] / "docs" / "plan.schema.json").read_text(encoding="utf-8"))
OLD_PLAN = HERE / "format_1.json"
"""The short turn below, as version 0.1.0 planned it."""
OLD_RUN = HERE.parent / "old_runs" / "hold_two"
SHORT_TURN: dict[str, object] = {
    "goal.rotation.angle_deg": 15.0,
    "start.contacts_deg": [[36.0, 0.0], [180.0, 0.0], "free"],
}
"""One finger is placed and one is lifted."""
QUESTIONS: dict[str, tuple[str, dict[str, object]]] = {
    "turn": ("fig4_substitution", SHORT_TURN),
    "hold": ("hold_three", {}),
    "fixed": ("fixed_contacts", {}),
    "rolls": ("fig3_rewind", {}),
    "adjusts": ("adjust_grasp", {}),
    "simultaneous": (
        "hold_two",
        {
            "start.contacts_deg": [[-38.0, 0.0], [102.0, 0.0], "free"],
            "goal": {
                "kind": "dextrous_manipulation",
                "order": "simultaneous",
                "rotation": {"axis": [0.1, 0.0, 1.0], "angle_deg": 24.0},
                "contacts_deg": [[-38.0, 0.0], [102.0, 0.0], [205.0, 10.0]],
            },
        },
    ),
    "refused": ("hold_two", {"object.mass_kg": 5.0}),
}


@pytest.fixture(scope="module")
def plans() -> dict[str, Plan]:
    return {key: pipeline.plan(load_problem(name, changes)) for key, (name, changes) in QUESTIONS.items()}


def as_file(plan: Plan) -> Any:
    return json.loads(json.dumps(plan.as_dict(), allow_nan=False))


@pytest.mark.parametrize("key", list(QUESTIONS))
def test_plans_are_written_as_the_schema_says(plans: dict[str, Plan], key: str) -> None:
    data = as_file(plans[key])
    assert list(find_faults(data, SCHEMA, SCHEMA)) == []
    assert Plan.from_dict(data).as_dict() == data
    # What can be run has no gap.
    for action in data["actions"]:
        assert all(phase["duration_s"] > 0.0 for phase in action["phases"])
        assert action.get("pace", True)
        assert len(action["ways"]) == any(phase["name"] == "travel" for phase in action["phases"]) or (
            action["kind"] == "move_object"
        )


def test_the_schema_names_every_status_and_kind_of_refusal(plans: dict[str, Plan]) -> None:
    assert set(SCHEMA["properties"]["status"]["enum"]) == {str(status) for status in Status}
    assert set(SCHEMA["$defs"]["refusal"]["properties"]["kind"]["enum"]) == {
        kind.value for kind in RefusalKind
    }
    assert not plans["refused"].is_solved


def test_questions_cover_every_kind_of_action(plans: dict[str, Plan]) -> None:
    kinds = {action.name for plan in plans.values() for action in plan.actions}
    assert kinds == {"hold", "roll", "move_object", "place", "lift"}
    moves = [a for a in plans["simultaneous"].actions if a.name == "move_object"]
    assert [way.finger for a in moves for way in a.ways] == [2]


def _forget(*path: Any) -> Callable[[Any], None]:
    def tamper(data: Any) -> None:
        for name in path[:-1]:
            data = data[name]
        del data[path[-1]]

    return tamper


def _set(value: Any, *path: Any) -> Callable[[Any], None]:
    def tamper(data: Any) -> None:
        for name in path[:-1]:
            data = data[name]
        data[path[-1]] = value

    return tamper


@pytest.mark.parametrize(
    "tamper",
    [
        _forget("touchdown"),
        _forget("actions", 1, "pace"),
        _set("dance", "actions", 0, "kind"),
        _set([0.0] * 6, "start", "object_pose"),
        _set(-1.0, "actions", 0, "phases", 0, "duration_s"),
        _set("maybe", "actions", 0, "phases", 0, "touch", "finger_1"),
        _set(1.0, "actions", 0, "more"),
        _set("luck", "actions", 1, "pace", "limit"),
    ],
)
def test_the_schema_refuses_what_is_no_plan(plans: dict[str, Plan], tamper: Callable[[Any], None]) -> None:
    data = copy.deepcopy(as_file(plans["turn"]))
    tamper(data)
    assert list(find_faults(data, SCHEMA, SCHEMA))


def test_an_action_that_contradicts_itself_is_not_read(plans: dict[str, Plan], tmp_path: Path) -> None:
    k = next(k for k, action in enumerate(plans["turn"].actions) if action.name == "place")
    for tamper, what in (
        (_set(3.0, "actions", 1, "rotation", "angle_deg"), "does not end at its object_pose_end"),
        (_set("lift", "actions", k, "kind"), "is called lift, and is a place"),
    ):
        data = as_file(plans["turn"])
        tamper(data)
        path = tmp_path / "plan.json"
        path.write_text(json.dumps(data))
        with pytest.raises(RunFolderError, match=what):
            Plan.load(path)


def test_the_reference_of_a_file_is_that_of_the_plan(plans: dict[str, Plan]) -> None:
    """Times and ways are read back to the bit; poses, which are rounded, to 1e-11."""
    for plan in plans.values():
        again = Plan.from_dict(as_file(plan))
        for a, b in zip(plan.actions, again.actions, strict=True):
            assert [p.duration for p in a.phases] == [p.duration for p in b.phases]
            for way, same in zip(a.ways, b.ways, strict=True):
                np.testing.assert_array_equal(way.postures, same.postures)
            np.testing.assert_allclose(b.X_WO_end, a.X_WO_end, atol=1e-11)


ALONE = """
import sys
from importlib.abc import MetaPathFinder

class NoPlanning(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name == "dexplan.planning" or name.startswith("dexplan.planning."):
            raise ImportError(f"{name} is not to be had here")

sys.meta_path.insert(0, NoPlanning())
from pathlib import Path
from dexplan.control.options import ControlOptions
from dexplan.control.reference import build_reference
from dexplan.plans.plan import Plan
from dexplan.scene.library import load_scene
from dexplan.sim.record.rollout import rollout

folder = Path(sys.argv[1])
plan = Plan.load(folder / "plan.json")
sliding, torsional, rate = map(float, sys.argv[2:])
trace = rollout(load_scene(), build_reference(plan), ControlOptions(sliding, torsional, rate=rate))
assert trace.meta["failure"] is None, trace.meta["failure"]
trace.save(folder / "trace.npz")
assert not any(name.startswith("dexplan.planning") for name in sys.modules)
"""


def test_a_plan_file_is_run_where_nothing_can_be_planned(plans: dict[str, Plan], tmp_path: Path) -> None:
    """Nothing but the file: the run places a finger, lifts another, and passes every check."""
    from dexplan.sim.trace import Trace

    problem, plan = load_problem(*QUESTIONS["turn"]), plans["turn"]
    assert {"place", "lift"} <= {action.name for action in plan.actions}
    plan.save(tmp_path / "plan.json")
    options = pipeline.build_options(problem)
    numbers = [repr(x) for x in (options.sliding, options.torsional, options.rate)]
    done = subprocess.run(
        [sys.executable, "-c", ALONE, str(tmp_path), *numbers], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    report = pipeline.validate(problem, plan, Trace.load(tmp_path / "trace.npz"))
    assert report.is_passed, report.table()


# -- format 1 ---------------------------------------------------------------------------------------------------------------


def _flatten(data: Any, where: str = "") -> dict[str, Any]:
    """Return every value of JSON data by the path to it."""
    inside = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    rows = {} if isinstance(data, dict | list) and data else {where: data}
    for key, value in inside:
        rows |= _flatten(value, f"{where}/{key}")
    return rows


def test_nothing_of_a_plan_of_format_1_is_lost() -> None:
    """What plans are compared by is what the file holds, number by number."""
    written = json.loads(OLD_PLAN.read_text(encoding="utf-8"))
    read = _flatten(as_compared(Plan.load(OLD_PLAN)))
    expected = _flatten({name: value for name, value in written.items() if name != "statistics"})
    assert read.keys() == expected.keys()
    for where, value in expected.items():
        assert read[where] == (pytest.approx(value, abs=1e-11) if isinstance(value, float) else value), where


def test_a_plan_of_format_1_can_be_shown() -> None:
    old = Plan.load(OLD_PLAN)
    assert [a.name for a in old.actions] == ["hold", "move_object", "place", "lift", "move_object", "hold"]
    assert all(action.why in old.explain() for action in old.actions)
    data = as_file(old)
    assert list(find_faults(data, SCHEMA, SCHEMA)) == []
    assert Plan.from_dict(data).as_dict() == data


def test_a_plan_of_format_1_is_not_run() -> None:
    old = Plan.load(OLD_PLAN)
    assert not old.is_timed
    with pytest.raises(DexplanError, match=r"format 1.*plan again") as refused:
        pipeline.rollout(load_problem(*QUESTIONS["turn"]), old)
    assert "\n" not in str(refused.value)


def test_a_plan_of_format_1_whose_fingers_travel_meanwhile_is_not_timed(plans: dict[str, Plan]) -> None:
    """Their arcs were not written, so nothing would bring the finger over its contact."""
    data = {**as_compared(plans["simultaneous"]), "statistics": {}}
    assert data["format"] == 1
    old = Plan.from_dict(data)
    assert old.explain() == plans["simultaneous"].explain()
    with pytest.raises(ValueError, match=r"no way of finger_3; plan again"):
        pipeline.time_plan(load_problem(*QUESTIONS["simultaneous"]), old)


def test_the_judge_reads_both_formats_alike() -> None:
    problem, plan, trace = pipeline.load_run(OLD_RUN)
    written = json.loads((OLD_RUN / "plan.json").read_text(encoding="utf-8"))
    old, new = (validate_run(problem.as_dict(), data, trace) for data in (written, plan.as_dict()))
    assert (written["format"], plan.as_dict()["format"]) == (1, 2)
    assert [(c.name, c.status, c.value) for c in old.checks] == [
        (c.name, c.status, c.value) for c in new.checks
    ]
    assert old.is_passed
    later = validate_run(problem.as_dict(), {**written, "format": 3}, trace)
    assert [check.name for check in later.failures] == ["files_agree"]
    assert "format 3" in later["files_agree"].note
