"""Reading problem files: the exact round trip, overrides, and one clear line for everything that is wrong."""

from __future__ import annotations

import dataclasses
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dexplan.errors import DexplanError, ProblemError, UnknownNameError
from dexplan.problems.override import parse_assignment
from dexplan.problems.problem import Problem, compute_contact_directions
from dexplan.problems.read import build_problem, list_problems, load_problem, set_override
from dexplan.problems.rules import load_limits
from dexplan.sim.judge.limits import INTEGRITY

GOAL = "[goal]\nrotation = { axis = [0.0, 0.0, 1.0], angle_deg = 90.0 }\n"
HEAD = 'format = 1\nname = "p"\n'


def _load(tmp_path: Path, text: str | bytes) -> Problem:
    path = tmp_path / "p.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return Problem.load(path)


def test_built_in_problems_read_and_say_what_they_are() -> None:
    problems = list_problems()
    assert {"fig4_substitution", "hold_two", "hold_three"} <= set(problems)
    assert all(problems.values())
    assert all(load_problem(name).name == name for name in problems)


def test_fig4_is_the_contract_example() -> None:
    problem = load_problem("fig4_substitution")
    assert problem.start.contacts_deg == ((-38.0, 0.0), (102.0, 0.0), "free")
    assert problem.goal.rotation is not None
    assert problem.goal.rotation.angle_deg == 360.0
    assert problem.gait.primitives == ("substitution",)
    assert problem.friction.believed_sliding == pytest.approx(0.55 / 1.3)
    assert problem.hand.finger_count == 3


def test_defaults_are_written_out_and_round_trip_exactly(tmp_path: Path) -> None:
    problem = _load(tmp_path, HEAD + GOAL)
    path = problem.save(tmp_path / "deep" / "copy.toml")
    text = path.read_text()
    for key in ("radius_m", "node_budget", "speed_deg_s", "tip_radii_m", "torsional_m", "order", "seed"):
        assert key in text
    again = Problem.load(path)
    assert again == problem
    assert hash(again) == hash(problem)
    assert again.as_dict() == problem.as_dict()
    assert pickle.loads(pickle.dumps(problem)) == problem
    assert set(problem.acceptance) == set(load_limits())
    assert [f.name for f in path.parent.iterdir()] == ["copy.toml"]


@given(
    angle=st.floats(-3.6e6, 3.6e6),
    mass=st.floats(1e-4, 100.0),
    axis=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda a: np.linalg.norm(a) > 1e-6),
    elevation=st.floats(-90.0, 90.0),
)
@settings(max_examples=40, deadline=None)
def test_every_bit_of_every_float_survives(
    tmp_path_factory: pytest.TempPathFactory,
    angle: float,
    mass: float,
    axis: tuple[float, float, float],
    elevation: float,
) -> None:
    overrides = {
        "goal.rotation.angle_deg": angle,
        "goal.rotation.axis": list(axis),
        "object.mass_kg": mass,
        "start.contacts_deg": [[0.1, elevation], "free", {"point_m": [0.0, 0.035, 0.0]}],
        "hand.joint_ranges_deg": {"finger_2.joint_1": [-1.0 / 3.0, 7]},
        "obstacles": [{"kind": "capsule", "pos_m": [0, 0, -0.1], "size_m": [0.01, 0.02]}],
    }
    problem = load_problem("hold_two", overrides)
    path = problem.save(tmp_path_factory.mktemp("p") / "p.toml")
    assert Problem.load(path) == problem
    assert load_problem("hold_two") != problem


def test_problem_is_really_frozen() -> None:
    problem = load_problem("hold_two")
    with pytest.raises(dataclasses.FrozenInstanceError):
        problem.seed = 1  # type: ignore[misc]
    with pytest.raises(TypeError):
        problem.acceptance["x"] = 1.0  # type: ignore[index]


def test_contact_directions_point_outward() -> None:
    problem = load_problem("hold_two", {"start.contacts_deg.2": {"point_m": [0.0, 0.0, -0.035]}})
    assert not problem.start.is_auto
    a, b, c = compute_contact_directions(problem.start.contacts_deg)  # type: ignore[arg-type]
    assert a is not None
    assert b is not None
    np.testing.assert_allclose(np.degrees(np.arccos(a @ b)), 140.0)
    np.testing.assert_allclose(c, [0.0, 0.0, -1.0])
    assert compute_contact_directions(("free",)) == (None,)


def test_set_override_takes_toml_values_and_list_entries() -> None:
    data: dict[str, Any] = {"format": 1, "goal": {"rotation": {"axis": [0, 0, 1], "angle_deg": 1}}}
    set_override(data, "goal.rotation.angle_deg", "1080")
    set_override(data, "hand.tip_radii_m.1", "0.02")
    set_override(data, 'hand.joint_ranges_deg."finger_1.joint_2"', "[-20, 30.5]")
    set_override(data, "hand.joint_ranges_deg.finger_3.joint_1", "[0, 1]")
    problem = build_problem(data, default_name="p")
    assert problem.goal.rotation is not None
    assert problem.goal.rotation.angle_deg == 1080.0
    assert problem.hand.tip_radii_m == (0.018, 0.02, 0.018)
    assert problem.hand.joint_ranges_deg == {
        "finger_1.joint_2": (-20.0, 30.5),
        "finger_3.joint_1": (0.0, 1.0),
    }
    assert parse_assignment("a.b = [1, 'x=y']") == ("a.b", [1, "x=y"])


def test_a_bare_word_is_text_for_shells_take_quotes_away() -> None:
    assert parse_assignment("goal.order=grasp_first") == ("goal.order", "grasp_first")
    assert parse_assignment("goal.order='grasp_first'") == ("goal.order", "grasp_first")
    assert parse_assignment("goal.keep_object=true") == ("goal.keep_object", True)


BAD_TEXT = {
    "": "is empty",
    "format = 1\n": "goal: missing",
    GOAL: "format: missing; accepted: format = 1",
    'format = 2\nname = "p"\n' + GOAL: "format: 2 is not",
    "format = true\n" + GOAL: "format: True is not".lower(),
    'format = 1\nname = "../p"\n' + GOAL: "name: '../p' is no name",
    HEAD + "[goal]\n": "goal: says nothing",
    HEAD + '[goal]\nkind = "object_manipulation"\n': "goal: names no goal",
    HEAD + "goal = 3\n": "goal: 3 does not fit",
    HEAD + "this is not toml": "is not TOML",
    HEAD + "x = " + "[" * 5000: "is not TOML",
    HEAD + "seed = 0x" + "f" * 5000 + "\n" + GOAL: "seed: the number has more than 64 bits",
    HEAD + "[goal]\nrotation = { axis = [0, 0, 1] }\n": "goal.rotation.angle_deg: missing",
}


@pytest.mark.parametrize(("text", "message"), BAD_TEXT.items(), ids=list(BAD_TEXT.values()))
def test_bad_texts(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ProblemError) as caught:
        _load(tmp_path, text)
    assert message in str(caught.value)
    assert "p.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


BAD_VALUES: list[tuple[str, Any, str]] = [
    ("objct", {"mass_kg": 1}, "objct: unknown key 'objct'; did you mean 'object'?"),
    ("object.mass", 1, "object.mass: unknown key 'mass'; did you mean 'mass_kg'?"),
    ("mass_kg", 1, "did you mean 'object.mass_kg'?"),
    ("object.mass_kg", "heavy", "object.mass_kg: 'heavy' does not fit; accepted: a number from"),
    ("object.mass_kg", True, "object.mass_kg: true does not fit"),
    ("object.mass_kg", -0.1, "object.mass_kg: -0.1 is out of range"),
    ("object.mass_kg", 0, "object.mass_kg: 0.0 is out of range"),
    ("object.radius_m", float("nan"), "object.radius_m: nan is not a finite number"),
    ("object.radius_m", float("inf"), "object.radius_m: inf is not a finite number"),
    ("object", 3, "object: 3 does not fit; accepted: a table"),
    ("object.allowed_regions", 1, "object.allowed_regions: 1 does not fit; accepted: a list of cones { axis"),
    (
        "object.allowed_regions",
        [{"axis": [0, 0, 0], "half_angle_deg": 10}],
        "object.allowed_regions[0].axis: [0.0, 0.0, 0.0] has no direction",
    ),
    (
        "object.allowed_regions",
        [{"axis": [0, 0, 1], "half_angle_deg": 181}],
        "object.allowed_regions[0].half_angle_deg: 181.0 is out of range; accepted: a number from 0.1 to 180 degrees",
    ),
    ("object.allowed_regions", [{"axis": [0, 0, 1]}], "object.allowed_regions[0].half_angle_deg: missing"),
    (
        "object.allowed_regions",
        [{"axis": [0, 0, 1], "half_angle": 1}],
        "object.allowed_regions[0].half_angle: unknown key 'half_angle'; did you mean 'half_angle_deg'?",
    ),
    ("scene", "two_fingers", "unknown scene 'two_fingers'; did you mean 'three_finger_sphere'?"),
    ("seed", -1, "seed: -1 is out of range; accepted: a whole number"),
    ("seed", 1.5, "seed: 1.5 does not fit"),
    (
        "hand.tip_radii_m",
        [0.018, 0.018],
        "hand.tip_radii_m: [0.018, 0.018] has 2 entries; accepted: 3 numbers",
    ),
    ("hand.tip_radii_m", [0.018, 0.018, -1], "hand.tip_radii_m[2]: -1.0 is out of range"),
    ("hand.base_azimuths_deg", [0], "hand.base_azimuths_deg: [0.0] has 1 entries"),
    ("hand.joint_ranges_deg", {"finger_4.joint_1": [0, 1]}, "no joint of three_finger_sphere"),
    ("hand.joint_ranges_deg", {"finger_1.joint_1": [1, 0]}, "[1.0, 0.0] is no range"),
    ("hand.joint_ranges_deg", {"finger_1.joint_1": [1]}, "[1] is no range"),
    ("friction.safety", 0.9, "friction.safety: 0.9 is out of range"),
    (
        "friction.torsional_m",
        0.006,
        "implies a contact patch of radius 18.5 mm on a tip of 18 mm; accepted: at most",
    ),
    ("friction.sliding", 0, "friction.sliding: 0.0 is out of range"),
    ("start.contacts_deg", [[0, 0], "free", "free"], "only 1 finger(s) touch"),
    ("start.contacts_deg", [[0, 0], [120, 0]], "start.contacts_deg: has 2 entries; accepted: 3 entries"),
    ("start.contacts_deg", [[0, 0], [120, 0], "off"], "start.contacts_deg[2]: 'off' does not fit"),
    ("start.contacts_deg", [[0, 0], [120], "free"], "start.contacts_deg[1]: [120] does not fit"),
    (
        "start.contacts_deg",
        [[0, 0], [120, 91], "free"],
        "start.contacts_deg[1]: elevation 91.0 is out of range",
    ),
    ("start.contacts_deg", [[0, 0], {"point_m": [1, 0, 0]}, "free"], "lies 1 m from the object's centre"),
    ("start.contacts_deg", [[0, 0], {"point": [1, 0, 0]}, "free"], "did you mean 'point_m'?"),
    ("start.contacts_deg", "automatic", "start.contacts_deg: 'automatic' does not fit"),
    ("goal.kind", "juggle", "goal.kind: 'juggle' does not fit; accepted: \"object_manipulation\""),
    ("goal.kind", "grasp_adjustment", "goal.contacts_deg: missing for kind"),
    ("goal.rotation.axis", [0, 0, 0], "goal.rotation.axis: [0.0, 0.0, 0.0] has no direction"),
    ("goal.rotation.axis", [0, 1], "goal.rotation.axis: [0, 1] does not fit; accepted: three numbers"),
    ("goal.orientation_wxyz", [1, 0, 0, 0], "both rotation and orientation_wxyz"),
    (
        "goal",
        {"kind": "object_manipulation", "contacts_deg": [[0, 0], [120, 0], [240, 0]]},
        'given for kind = "object_manipulation"',
    ),
    ("goal.order", "later", "goal.order: 'later' does not fit"),
    ("gait.primitives", ["substitute"], "gait.primitives[0]: 'substitute' does not fit"),
    ("gait.primitives", ["rewind", "rewind"], "repeats itself"),
    ("gait.node_budget", 0, "gait.node_budget: 0 is out of range"),
    ("control.physics_profile", "soft", "control.physics_profile: 'soft' does not fit"),
    ("control.force_solver", "ipopt", "control.force_solver: 'ipopt' does not fit; accepted: \"daqp\" or"),
    ("control.force_solver", 1, "control.force_solver: 1 does not fit"),
    ("control.speed_deg_s", 0, "control.speed_deg_s: 0.0 is out of range"),
    ("control.rate_hz", 300, 'control.rate_hz: 300 does not fit; accepted: "auto", 125, 250, 500 or 1000'),
    ("forces", 5.5, "forces: 5.5 does not fit; accepted: a table"),
    ("forces.normal", 5.5, "forces.normal: unknown key 'normal'; did you mean 'normal_N'?"),
    (
        "forces.normal_N",
        "strong",
        "forces.normal_N: 'strong' does not fit; accepted: a number from 0.1 to 100 N",
    ),
    ("forces.normal_N", -1, "forces.normal_N: -1.0 is out of range; accepted: a number from 0.1 to 100 N"),
    ("forces.normal_floor_N", 1000, "forces.normal_floor_N: 1000.0 is out of range"),
    (
        "forces",
        {"normal_N": 5, "normal_floor_N": 6},
        "forces.normal_floor_N: 6.0 is more than the 5.0 of forces.normal_N; accepted: normal_floor_N <= normal_N",
    ),
    (
        "forces",
        {"normal_N": 5, "normal_ceiling_N": 4.5},
        "forces.normal_ceiling_N: 4.5 is less than the 5.0 of forces.normal_N; accepted: normal_floor_N <= normal_N",
    ),
    (
        "forces",
        {"normal_floor_N": 6, "normal_ceiling_N": 5},
        "forces.normal_floor_N: 6.0 is more than the 5.0",
    ),
    ("margins", 1, "margins: 1 does not fit; accepted: a table"),
    (
        "margins.joint_deg",
        -1,
        "margins.joint_deg: -1.0 is out of range; accepted: a number from 0 to 45 degrees",
    ),
    (
        "margins.clearance_mm",
        8,
        "margins.clearance_mm: 8.0 is out of range; accepted: a number from 0 to 7 mm",
    ),
    ("margins.clearance_m", 0.002, "unknown key 'clearance_m'; did you mean 'clearance_mm'?"),
    (
        "margins.cone_share",
        1.0,
        "margins.cone_share: 1.0 is out of range; accepted: a number from 0.05 to 0.99",
    ),
    ("margins.torque_share", 0, "margins.torque_share: 0.0 is out of range"),
    (
        "margins.torque_share",
        True,
        "margins.torque_share: true does not fit; accepted: a number from 0.05 to 0.93",
    ),
    ("obstacles", [{"kind": "cone", "pos_m": [0, 0, 0], "size_m": [1]}], "obstacles[0].kind: 'cone'"),
    (
        "obstacles",
        [{"kind": "box", "pos_m": [0, 0, 0], "size_m": [1]}],
        "accepted: three half sizes of a box",
    ),
    ("obstacles", [{"kind": "sphere", "size_m": [1]}], "obstacles[0].pos_m: missing"),
    ("obstacles", [{"kind": "sphere", "pos_m": [0, 0, 0], "size_m": [0]}], "obstacles[0].size_m[0]: 0.0"),
    (
        "obstacles",
        [{"kind": "sphere", "pos": 1}],
        "obstacles[0].pos: unknown key 'pos'; did you mean 'pos_m'?",
    ),
    ("acceptance", 3, "acceptance: 3 is no table"),
    ("acceptance.no_such_limit", 3, "acceptance.no_such_limit: unknown limit 'no_such_limit'"),
    ("summary", "two\nlines", "summary: 'two\\nlines' is no summary"),
]


@pytest.mark.parametrize(
    ("key", "value", "message"), BAD_VALUES, ids=[f"{k}-{i}" for i, (k, *_) in enumerate(BAD_VALUES)]
)
def test_bad_values(key: str, value: Any, message: str) -> None:
    with pytest.raises(ProblemError) as caught:
        load_problem("hold_two", {key: value})
    assert message in str(caught.value)
    assert str(caught.value).startswith("hold_two: ")
    assert "\n" not in str(caught.value)


def test_goal_attitude_zero_quaternion() -> None:
    goal = {"orientation_wxyz": [0, 0, 0, 0]}
    with pytest.raises(ProblemError, match=r"goal.orientation_wxyz: .* is no attitude"):
        load_problem("hold_two", {"goal": goal})
    assert load_problem("hold_two", {"goal": {"orientation_wxyz": [0, 0, 0, 2]}}).goal.rotation is None


def test_grasp_adjustment_leaves_the_object_alone() -> None:
    goal: dict[str, Any] = {"kind": "grasp_adjustment", "contacts_deg": [[0, 0], [140, 0], "free"]}
    assert load_problem("hold_two", {"goal": goal}).goal.contacts_deg == ((0.0, 0.0), (140.0, 0.0), "free")
    with pytest.raises(ProblemError, match="a motion of the object"):
        load_problem("hold_two", {"goal": {**goal, "translation_m": [0, 0, 0.01]}})


def test_only_a_grasp_adjustment_may_keep_the_object() -> None:
    goal: dict[str, Any] = {"kind": "grasp_adjustment", "contacts_deg": [[0, 0], [140, 0], "free"]}
    assert not load_problem("hold_two", {"goal": goal}).goal.keep_object
    assert load_problem("hold_two", {"goal": {**goal, "keep_object": True}}).goal.keep_object
    with pytest.raises(ProblemError, match=r"goal.keep_object: true for kind = .* accepted: false here"):
        load_problem("hold_two", {"goal.keep_object": True})
    with pytest.raises(ProblemError, match=r"goal.keep_object: .* accepted: true or false"):
        load_problem("hold_two", {"goal": {**goal, "keep_object": "yes"}})


@pytest.mark.parametrize("name", INTEGRITY)
def test_integrity_cannot_be_set(name: str) -> None:
    default = load_limits()[name]
    # Run folders write all defaults out.
    assert load_problem("hold_two", {f"acceptance.{name}": default}).acceptance[name] == default
    for value in (default + 1.0, 1000, default + 1e-12):
        with pytest.raises(ProblemError) as caught:
            load_problem("hold_two", {f"acceptance.{name}": value})
        assert str(caught.value).startswith(
            f"hold_two: acceptance.{name}: {value:g} is given for what cannot be set"
        )
        assert str(caught.value).endswith(f"accepted: {default:g}, or no such line")


@pytest.mark.parametrize("value", [-1.0, -1e-300, float("nan"), float("inf"), -float("inf")])
def test_limits_are_numbers_from_nothing_up(value: float) -> None:
    for name in load_limits():
        with pytest.raises(ProblemError, match=f"acceptance.{name}: .* accepted: "):
            load_problem("hold_two", {f"acceptance.{name}": value})


def test_limits_may_be_replaced_but_not_invented() -> None:
    for name, default in load_limits().items():
        if name in INTEGRITY:
            continue
        value: bool | float = (not default) if isinstance(default, bool) else default + 1.0
        assert load_problem("hold_two", {f"acceptance.{name}": value}).acceptance[name] == value
        with pytest.raises(ProblemError, match=f"did you mean '{name}'"):
            load_problem("hold_two", {f"acceptance.{name}x": value})
        with pytest.raises(ProblemError, match=f"acceptance.{name}: 'x'"):
            load_problem("hold_two", {f"acceptance.{name}": "x"})


@pytest.mark.parametrize(
    "text", ["", "x", "=1", "a.b=", "a b=1", "a=b c", "a=[b]", "a=1\nc=2", "a[0]=1", "a#=1", "a..b=1"]
)
def test_malformed_assignments(text: str) -> None:
    with pytest.raises(ProblemError, match="accepted:"):
        parse_assignment(text)


@pytest.mark.parametrize("key", ["hand.tip_radii_m.3", "hand.tip_radii_m.-1", "hand.tip_radii_m.x", "seed.a"])
def test_overrides_that_lead_nowhere(key: str) -> None:
    with pytest.raises(ProblemError, match="accepted:"):
        load_problem("fig4_substitution", {key: 1})


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown problem 'fig5'; known: .*fig4_substitution"):
        load_problem("fig5")
    with pytest.raises(ProblemError, match="no such file; accepted: a problem file in TOML"):
        load_problem(tmp_path / "absent.toml")
    with pytest.raises(ProblemError, match="is a directory"):
        load_problem(tmp_path)
    with pytest.raises(ProblemError, match="not a regular file"):
        load_problem("/dev/null")
    for name in ("a\0b.toml", "x" * 5000, "x" * 5000 + ".toml"):
        with pytest.raises(DexplanError):
            load_problem(name)


@given(st.binary(max_size=200))
@settings(max_examples=60, deadline=None)
def test_junk_is_refused_in_one_line(tmp_path_factory: pytest.TempPathFactory, junk: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "junk.toml"
    path.write_bytes(junk)
    with pytest.raises(ProblemError) as caught:
        load_problem(path)
    assert len(str(caught.value).splitlines()) == 1
