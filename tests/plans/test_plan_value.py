"""A plan is data: it survives a file, it hangs together, and it says what it does."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.errors import RunFolderError
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.actions import Relocate
from dexplan.plans.phases import MAY, MUST, MUST_NOT
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem
from dexplan.spatial import rotate_about


def test_round_trip_is_exact(full_turn: Plan, tmp_path: Path) -> None:
    first, second = tmp_path / "first.json", tmp_path / "second.json"
    full_turn.save(first)
    loaded = Plan.load(first)
    assert loaded.as_dict() == full_turn.as_dict()
    loaded.save(second)
    assert second.read_bytes() == first.read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["first.json", "second.json"]


def test_refusal_survives_a_file(full_turn: Plan, tmp_path: Path) -> None:
    refusal = Plan(
        "no_gait", "a reason", full_turn.fingers, full_turn.goal_kind, full_turn.X_WO_start,
        full_turn.X_WO_goal, None, None, (None,) * 3, (), 5.0,
    )  # fmt: skip
    refusal.save(tmp_path / "plan.json")
    loaded = Plan.load(tmp_path / "plan.json")
    assert loaded.as_dict() == refusal.as_dict()
    assert not loaded.is_solved
    assert loaded.axis_W is None


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": 99}', "not json"])
def test_other_files_are_refused_by_name(text: str, tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text(text)
    with pytest.raises(RunFolderError, match=r"plan\.json"):
        Plan.load(path)


def test_same_problem_gives_the_same_bytes(problem: Problem, full_turn: Plan, tmp_path: Path) -> None:
    full_turn.save(tmp_path / "first.json")
    pipeline.plan(problem).save(tmp_path / "second.json")
    assert (tmp_path / "first.json").read_bytes() == (tmp_path / "second.json").read_bytes()


def test_arrays_cannot_be_written(full_turn: Plan) -> None:
    placement = full_turn.start_contacts[0]
    assert placement is not None
    arrays = [full_turn.X_WO_goal, full_turn.actions[1].X_WO_end, placement.q, placement.X_OF]
    assert not any(array.flags.writeable for array in arrays)


def test_explanation_mentions_every_action(full_turn: Plan) -> None:
    text = full_turn.explain()
    assert text.startswith("status: solved")
    numbered = [line for line in text.splitlines() if line.lstrip()[:1].isdigit()]
    assert len(numbered) == len(full_turn.actions)
    for k, (line, action) in enumerate(zip(numbered, full_turn.actions, strict=True)):
        assert line.strip().startswith(f"{k + 1}. ")
        assert action.why in line
        for finger in action.grasping:
            assert full_turn.fingers[finger] in line
        if isinstance(action, Relocate):
            assert f"{action.name} {full_turn.fingers[action.finger]} at azimuth" in line
        if action.name == "move_object":
            assert f"{np.degrees(action.motion.angle):.1f} deg" in line


def test_explanation_says_by_how_much_the_object_is_shifted(full_turn: Plan) -> None:
    k, move = next((k, a) for k, a in enumerate(full_turn.actions) if a.name == "move_object")
    assert "shift" not in full_turn.explain()
    for shift, angle, words in (
        ([0.0, 0.002, -0.09], 0.0, "shift the object by (0.0, 2.0, -90.0) mm, held by"),
        (
            [0.005, 0.0, 0.0],
            0.5,
            "turn the object by 28.6 deg about (0.00, 0.00, 1.00) and shift it by (5.0, 0.0, 0.0) mm, held by",
        ),
    ):
        shifted = replace(move, motion=replace(move.motion, angle=angle, shift_W=np.array(shift)))
        actions = (*full_turn.actions[:k], shifted, *full_turn.actions[k + 1 :])
        assert words in replace(full_turn, actions=actions).explain()


def test_every_phase_makes_a_demand_on_every_finger(full_turn: Plan) -> None:
    before = full_turn.start_contacts
    for action in full_turn.actions:
        assert action.phases
        for phase in action.phases:
            assert len(phase.touch) == len(full_turn.fingers)
            assert set(phase.touch) <= {MUST, MAY, MUST_NOT}
            # Only the finger that is placed or lifted may change, the others do as they did.
            for finger, demand in enumerate(phase.touch):
                if not isinstance(action, Relocate) or finger != action.finger:
                    assert demand == (MUST_NOT if before[finger] is None else MUST)
        after = [c is not None for c in action.contacts_end]
        assert [demand == MUST for demand in action.phases[-1].touch] == after
        before = action.contacts_end


def test_contacts_change_only_by_placing_and_lifting(full_turn: Plan) -> None:
    before = full_turn.start_contacts
    for action in full_turn.actions:
        changed = []
        for finger, (old, new) in enumerate(zip(before, action.contacts_end, strict=True)):
            if (old is None) != (new is None):
                changed.append(finger)
            elif old is not None and new is not None:
                assert np.array_equal(old.X_OF, new.X_OF)
                assert np.array_equal(old.point_O, new.point_O)
                assert new.finger == finger
        assert changed == ([action.finger] if isinstance(action, Relocate) else [])
        if isinstance(action, Relocate):
            assert (action.contacts_end[action.finger] is not None) == action.is_placing
        # Whoever is said to hold throughout did hold, and does still.
        for finger in action.grasping:
            assert before[finger] is not None
            assert action.contacts_end[finger] is not None
        assert len(action.grasping) >= 2
        before = action.contacts_end


def test_object_poses_chain_to_the_goal(full_turn: Plan) -> None:
    actions = full_turn.actions
    assert np.array_equal(actions[0].X_WO_start, full_turn.X_WO_start)
    for one, other in pairwise(actions):
        assert np.allclose(one.X_WO_end, other.X_WO_start, atol=1e-12)
    for action in actions:
        turned = rotate_about(action.motion.axis_W, action.motion.angle) @ action.X_WO_start[:3, :3]
        assert np.allclose(turned, action.X_WO_end[:3, :3], atol=1e-12)
    assert np.allclose(actions[-1].X_WO_end, full_turn.X_WO_goal, atol=1e-12)
    # A whole turn is not nothing: the turns add up to it.
    assert full_turn.turned_angle == pytest.approx(2.0 * np.pi)
    assert sum(a.motion.angle for a in actions) == pytest.approx(full_turn.turned_angle, abs=1e-9)


def test_fingers_keep_their_order_in_every_grasp(hand: HandModel, full_turn: Plan) -> None:
    def order(azimuths: list[float]) -> list[int]:
        ranked = [int(i) for i in np.argsort(azimuths)]
        return [*ranked[ranked.index(0) :], *ranked[: ranked.index(0)]]

    center = hand.object.X_WO_home[:2, 3]
    bases = [f.chain.offsets[0][:2, 3] - center for f in hand.fingers]
    expected = order([float(np.arctan2(y, x)) for x, y in bases])
    three = 0
    for action in full_turn.actions:
        # At both ends: a free finger may have to make room while the others turn.
        for X_WO in (action.X_WO_start, action.X_WO_end):
            stand = []
            for finger, contact in zip(hand.fingers, action.contacts_end, strict=True):
                if contact is None:
                    stand.append(finger.pose_at(finger.q_home)[:2, 3] - center)
                else:
                    stand.append((X_WO[:3, :3] @ contact.normal_O)[:2])
            assert order([float(np.arctan2(y, x)) for x, y in stand]) == expected
        three += all(c is not None for c in action.contacts_end)
    assert three > 0
