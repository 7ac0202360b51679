"""Fixed contacts: a grasp goes as far as it can, the limit has a name, and beyond it a gait is the cure."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.errors import ProblemError
from dexplan.planning.admissible.admissibility import Admissibility, compute_finger_states
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import RefusalKind
from dexplan.problems.read import load_problem
from dexplan.spatial import rotate_about


def plan(changes: Mapping[str, object] = {}) -> Plan:
    return pipeline.plan(load_problem("fixed_contacts", changes))


@pytest.fixture(scope="module")
def beyond() -> Plan:
    return plan({"goal.rotation.angle_deg": 120.0})


def test_the_built_in_goal_is_reached_without_lifting() -> None:
    found = plan()
    assert found.is_solved, found.reason
    assert [a.name for a in found.actions] == ["hold", "move_object", "hold"]
    assert found.actions[1].grasping == (0, 1, 2)
    assert found.actions[1].limiting_finger is None
    np.testing.assert_allclose(found.actions[-1].X_WO_end, found.X_WO_goal, atol=1e-12)
    assert found.statistics["reach_deg"] >= 72.0
    assert "this grasp could turn it to" in found.actions[-1].why


def test_beyond_the_limit_is_a_truthful_no(beyond: Plan) -> None:
    assert beyond.status == "limit_reached"
    reached = np.degrees(beyond.actions[1].motion.angle)
    assert f"goes {reached:.1f} of 120.0 deg, until finger_2" in beyond.reason
    assert 'allow "substitution" or "rewind" in gait.primitives' in beyond.reason
    assert beyond.actions[1].limiting_finger == 1
    assert beyond.turned_angle == pytest.approx(np.radians(120.0))
    # The actions that are left can be run: each begins where the one before ends.
    for a, b in zip(beyond.actions, beyond.actions[1:], strict=False):
        np.testing.assert_allclose(a.X_WO_end, b.X_WO_start, atol=1e-12)
    assert "as far as the grasp goes" in beyond.explain()


def test_the_limit_is_where_the_judge_says_no(beyond: Plan) -> None:
    """Half a degree further the finger that is named breaks a limit; every state before is admissible."""
    problem = load_problem("fixed_contacts")
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    judge, move = Admissibility(hand), beyond.actions[1]
    refusals = []
    for angle in (0.0, 0.5 * move.motion.angle, move.motion.angle, move.motion.angle + np.radians(1.0)):
        X_WO = move.X_WO_start.copy()
        X_WO[:3, :3] = rotate_about(move.motion.axis_W, angle) @ X_WO[:3, :3]
        q = hand.q_home.copy()
        for c in move.contacts_end:
            assert c is not None
            solved, reached = hand.workspaces[c.finger].solve((X_WO @ c.X_OF)[None])
            assert reached[0]
            q[c.finger] = solved[0]
        refusals.append(judge.compute_margins(q, X_WO, (0, 1, 2), axis_W=move.motion.axis_W).refusal)
        least = min(range(3), key=lambda f: compute_finger_states(hand, f, q[f][None])[0].dexterity)
    assert refusals[:3] == [None] * 3
    assert refusals[3] is not None
    assert (refusals[3].kind, refusals[3].subject) == (RefusalKind.SINGULAR, ("finger_2",))
    assert beyond.refusal is not None
    assert (beyond.refusal.kind, beyond.refusal.subject) == (RefusalKind.SINGULAR, ("finger_2",))
    assert least == 1


def test_the_other_way_round_the_mirrored_finger_ends_it(beyond: Plan) -> None:
    back = plan({"goal.rotation.angle_deg": -120.0})
    assert back.actions[1].motion.angle == pytest.approx(-beyond.actions[1].motion.angle)
    assert back.actions[1].limiting_finger == 2


def test_gaits_go_beyond() -> None:
    problem = load_problem(
        "fixed_contacts", {"goal.rotation.angle_deg": 120.0, "gait.primitives": ["substitution"]}
    )
    assert pipeline.plan(problem).is_solved


def test_shifts_and_attitudes_too() -> None:
    shifted = plan({"goal": {"translation_m": [0.0, 0.0, 0.01]}})
    assert shifted.is_solved, shifted.reason
    assert shifted.actions[1].X_WO_end[2, 3] == pytest.approx(shifted.X_WO_start[2, 3] + 0.01)
    far = plan({"goal": {"translation_m": [0.0, 0.0, 0.5]}})
    assert far.status == "limit_reached"
    assert "of 500.0 mm, until" in far.reason
    tilted = plan({"goal": {"orientation_wxyz": [0.98, 0.1, 0.1, 0.0]}})
    assert tilted.is_solved, tilted.reason
    assert tilted.turned_angle is None


def test_a_start_that_does_not_hold_is_refused_as_ever() -> None:
    assert plan({"start.contacts_deg": [[140.0, 0.0], [-80.0, 0.0], "free"]}).status == "start_unreachable"


def test_goal_contacts_need_a_gait() -> None:
    with pytest.raises(ProblemError, match=r"gait.primitives: \[\] keeps the contacts as they are"):
        load_problem("adjust_grasp", {"gait.primitives": []})
