"""What a file leaves out follows what it says: no default is a reason to refuse a written key."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import pytest

from dexplan.errors import ProblemError
from dexplan.problems.derived import as_name
from dexplan.problems.problem import Problem
from dexplan.problems.read import build_problem, list_problems, load_problem
from dexplan.problems.rules import NAME_PATTERN, load_joint_ranges

TURN = "format = 1\n[goal]\nrotation = { axis = [0, 0, 1], angle_deg = 1 }\n"
GRASP = [[0.0, 0.0], [120.0, 0.0], [240.0, 0.0]]
ROTATION = {"axis": [0.0, 0.0, 1.0], "angle_deg": 5.0}


@pytest.mark.parametrize(
    ("sliding", "tips"),
    list(product([None, 0.01, 0.3, 0.44, 0.55, 5.0], [None, [0.006, 0.018, 0.03], [0.001] * 3])),
)
def test_torsion_follows_friction_and_tips(
    sliding: float | None, tips: list[float] | None, tmp_path: Path
) -> None:
    changes: dict[str, object] = {} if sliding is None else {"friction.sliding": sliding}
    if tips is not None:
        changes["hand.tip_radii_m"] = tips
    problem = load_problem("hold_two", changes)
    bound = 0.3 * (0.55 if sliding is None else sliding) * min(tips or [0.018])
    assert problem.friction.torsional_m == pytest.approx(min(0.0025, bound), rel=1e-12)
    copy = problem.save(tmp_path / "copy.toml")
    assert Problem.load(copy) == problem
    # All defaults stand in the copy, and it takes what the file takes.
    if tips is not None:
        changes["hand.tip_radii_m"] = tips
    for later in ({"friction.sliding": 0.2}, {"friction.sliding": 0.9}, {"hand.tip_radii_m.1": 0.004}):
        assert load_problem(copy, later) == load_problem("hold_two", {**changes, **later})


@pytest.mark.parametrize("name", list_problems())
@pytest.mark.parametrize(("key", "value"), [("friction.sliding", 0.05), ("hand.tip_radii_m.0", 0.004)])
def test_friction_and_tips_of_every_problem_can_be_changed_alone(name: str, key: str, value: float) -> None:
    assert load_problem(name, {key: value}).friction.torsional_m < 0.0025


@pytest.mark.parametrize("key", ["friction.torsional_m", "hand.tip_radii_m"])
def test_what_is_written_is_still_refused(key: str) -> None:
    with pytest.raises(ProblemError, match=r"friction\.torsional_m: 0\.0026"):
        load_problem("hold_two", {"friction.torsional_m": 0.0026, "friction.sliding": 0.4})


@pytest.mark.parametrize(
    ("goal", "kind"),
    [
        ({"rotation": ROTATION}, "object_manipulation"),
        ({"translation_m": [0.0, 0.0, 0.01]}, "object_manipulation"),
        ({"contacts_deg": GRASP}, "grasp_adjustment"),
        ({"contacts_deg": GRASP, "keep_object": True}, "grasp_adjustment"),
        ({"contacts_deg": GRASP, "translation_m": [0.0, 0.0, 0.0]}, "grasp_adjustment"),
        ({"contacts_deg": GRASP, "rotation": ROTATION}, "dextrous_manipulation"),
        ({"contacts_deg": GRASP, "orientation_wxyz": "random"}, "dextrous_manipulation"),
        ({"contacts_deg": GRASP, "translation_m": [0.0, 0.0, 0.01]}, "dextrous_manipulation"),
    ],
)
def test_the_kind_of_a_goal_follows_its_keys(goal: dict[str, Any], kind: str) -> None:
    assert build_problem({"format": 1, "goal": goal}, default_name="p").goal.kind == kind


NAMES = {
    "my problem": "my_problem",
    "Bälle größer.v2 ": "Balle_grosser.v2",
    "  a  ": "a",
    "...": "problem",
    "日本": "problem",
    "-x-": "x",
    "x" * 200: "x" * 100,
    "a\nb": "a_b",
    "fig4_substitution": "fig4_substitution",
}


@pytest.mark.parametrize("stem", [stem for stem in NAMES if len(stem) < 200 and "\n" not in stem])
def test_any_file_name_makes_a_name(stem: str, tmp_path: Path) -> None:
    path = tmp_path / f"{stem}.toml"
    path.write_text(TURN, encoding="utf-8")
    assert load_problem(path).name == NAMES[stem]


@pytest.mark.parametrize("text", NAMES)
def test_names_are_names(text: str) -> None:
    assert as_name(text) == NAMES[text]
    assert NAME_PATTERN.fullmatch(as_name(text))


def test_a_written_name_is_refused_with_one_that_would_do() -> None:
    with pytest.raises(ProblemError, match=r"name: 'my problem' is no name .* such as 'my_problem'"):
        load_problem("hold_two", {"name": "my problem"})


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_bytes(b"\xef\xbb\xbf" + TURN.replace("\n", "\r\n").encode())
    assert load_problem(path).name == "p"


def test_joint_ranges_are_those_of_the_model() -> None:
    from dexplan.scene.library import load_scene

    chain = load_scene().fingers[0].chain
    for index, (lowest, highest) in enumerate(load_joint_ranges().values()):
        assert 0.0 <= lowest - chain.lower[index] * 180.0 / 3.141592653589793 <= 0.01
        assert 0.0 <= chain.upper[index] * 180.0 / 3.141592653589793 - highest <= 0.01


@pytest.mark.parametrize("finger", [1, 2, 3])
@pytest.mark.parametrize("joint", ["joint_1", "joint_2", "joint_6"])
def test_joint_ranges_are_only_narrowed(finger: int, joint: str) -> None:
    least, most = load_joint_ranges()[joint]
    key = f"hand.joint_ranges_deg.finger_{finger}.{joint}"
    assert load_problem("hold_two", {key: [least, most]}).hand.joint_ranges_deg[
        f"finger_{finger}.{joint}"
    ] == (least, most)
    for wrong in ([-340.0, 340.0], [least - 0.1, 0.0], [0.0, most + 0.1], [-720.0, 0.0]):
        with pytest.raises(ProblemError) as caught:
            load_problem("hold_two", {key: wrong})
        assert str(caught.value).startswith(f"hold_two: {key}: ")
        assert f"from {least:g} to {most:g}" in str(caught.value)
    for wrong in ([3.0, 3.0], [4.0, 3.0]):
        with pytest.raises(ProblemError, match="is no range"):
            load_problem("hold_two", {key: wrong})


@pytest.mark.parametrize(
    ("written", "forces"),
    [
        ({}, (4.0, 5.5, 12.0)),
        ({"normal_N": 5.5}, (4.0, 5.5, 12.0)),
        ({"normal_N": 8.0}, (4.0, 8.0, 12.0)),
        ({"normal_N": 20.0}, (4.0, 20.0, 20.0)),
        ({"normal_N": 2.75}, (2.0, 2.75, 12.0)),
        ({"normal_floor_N": 7.0}, (7.0, 7.0, 12.0)),
        ({"normal_floor_N": 1.0}, (1.0, 5.5, 12.0)),
        ({"normal_ceiling_N": 2.75}, (2.0, 2.75, 2.75)),
        ({"normal_ceiling_N": 30.0}, (4.0, 5.5, 30.0)),
        ({"normal_floor_N": 1.0, "normal_N": 2.0, "normal_ceiling_N": 3.0}, (1.0, 2.0, 3.0)),
    ],
)
def test_normal_forces_that_are_left_out_make_room_for_those_that_are_written(
    written: dict[str, float], forces: tuple[float, float, float], tmp_path: Path
) -> None:
    problem = load_problem("hold_two", {f"forces.{key}": value for key, value in written.items()})
    found = problem.forces
    assert (found.normal_floor_N, found.normal_N, found.normal_ceiling_N) == pytest.approx(forces)
    # A copy with all defaults written out takes what the file takes that it came from.
    copy = problem.save(tmp_path / "copy.toml")
    assert load_problem(copy) == problem
    for key, value in (("normal_N", 2.0), ("normal_N", 30.0), ("normal_floor_N", 9.0)):
        if set(written) <= {key}:
            assert (
                load_problem(copy, {f"forces.{key}": value}).forces
                == load_problem("hold_two", {f"forces.{key}": value}).forces
            )


def test_a_written_floor_stays_and_is_refused(tmp_path: Path) -> None:
    copy = load_problem("hold_two", {"forces.normal_floor_N": 3.0}).save(tmp_path / "copy.toml")
    with pytest.raises(ProblemError, match=r"forces\.normal_floor_N: 3\.0 is more than the 2\.0"):
        load_problem(copy, {"forces.normal_N": 2.0})
