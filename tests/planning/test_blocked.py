"""What is in the way is named, and only what is in a plan's way is: obstacles, overlaps, fingers at home, joints, friction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.contact.friction import SoftFinger
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.tasks.blocked import find_obstruction
from dexplan.planning.tasks.pair_survey import refuse_every_pair
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Cure, RefusalKind
from dexplan.plans.status import Status
from dexplan.problems.read import build_problem, load_problem

CASES = Path(__file__).resolve().parents[1] / "cases"
PAIR = [[-38.0, 0.0], [102.0, 0.0], "free"]
TURN = {"rotation": {"axis": [0.0, 0.0, 1.0], "angle_deg": 10.0}}


def plan(start: Any = PAIR, **sections: Any) -> Plan:
    data = {"format": 1, "name": "blocked", "start": {"contacts_deg": start}, "goal": TURN}
    return pipeline.plan(build_problem({**data, **sections}))


def sphere(x: float, y: float, z: float, radius: float) -> dict[str, Any]:
    return {"kind": "sphere", "pos_m": [x, y, z], "size_m": [radius]}


def case(name: str) -> Plan:
    return pipeline.plan(load_problem(CASES / f"{name}.toml"))


# -- overlaps that nothing changes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("obstacle", "finger", "depth"),
    [
        (sphere(0.18, 0.0, 0.21, 0.004), 1, 19.0),
        (sphere(0.18, 0.0, 0.228, 0.004), 1, 1.0),
        ({"kind": "box", "pos_m": [-0.09, 0.1559, 0.21], "size_m": [0.003, 0.003, 0.003]}, 2, None),
        ({"kind": "capsule", "pos_m": [-0.09, -0.1559, 0.21], "size_m": [0.004, 0.02]}, 3, 19.0),
    ],
)
def test_an_obstacle_in_a_link_that_never_moves_against_it(
    obstacle: dict[str, Any], finger: int, depth: float | None
) -> None:
    refused = plan(obstacles=[obstacle])
    assert refused.status == "blocked"
    assert f"finger_{finger}/link_1" in refused.reason
    assert "obstacle_1" in refused.reason
    assert "overlap" in refused.reason
    assert "move or shrink the obstacle" in refused.reason
    if depth is not None:
        assert f"{depth:.1f} mm" in refused.reason


def test_the_case_of_an_obstacle_in_a_link_and_of_two_fingers_on_one_base() -> None:
    inside, shared = case("obstacle_in_link"), case("same_base")
    assert (inside.status, shared.status) == ("blocked", "blocked")
    assert "obstacle_1 and finger_1/link_1 overlap by 19.0 mm" in inside.reason
    assert "finger_1/link_1 and finger_2/link_1 overlap by 30.0 mm" in shared.reason
    assert "hand.base_azimuths_deg" in shared.reason


@pytest.mark.parametrize(
    "obstacles",
    [
        [sphere(0.0, 0.0, 0.0, 0.01)],  # in the floor
        [sphere(0.3, 0.3, 0.1, 0.02), sphere(0.3, 0.31, 0.1, 0.02)],  # in one another
        [sphere(0.18, 0.0, 0.08, 0.01)],  # in a base, which stands as still as the obstacle
        [{"kind": "box", "pos_m": [50.0, 0.0, 0.0], "size_m": [1.0, 1.0, 1.0]}],
    ],
)
def test_overlaps_of_what_stands_still_are_in_nobodys_way(obstacles: list[dict[str, Any]]) -> None:
    assert plan(obstacles=obstacles).is_solved


# -- at home, at the start, at the goal ----------------------------------------------------------------------------------


def test_fingers_that_overlap_at_home_are_no_obstacle_where_one_of_them_holds() -> None:
    near = load_problem(CASES / "two_fingers_side_by_side.toml")
    assert find_obstruction(pipeline.build_hand(near, pipeline.build_scene(near))) is None
    far = case("two_fingers_far_obstacle")
    assert far.is_solved, far.reason
    # Their first links are 1.4 mm apart whatever they do: neither may ever be free.
    assert {c.finger for c in far.start_contacts if c is not None} == {0, 1}


def test_an_obstacle_where_a_free_finger_waits() -> None:
    hand = pipeline.build_hand(
        problem := load_problem("hold_two", {"obstacles": [sphere(*_home(2), 0.01)]}),
        pipeline.build_scene(problem),
    )
    assert find_obstruction(hand, waiting=(0,)) is None
    no = find_obstruction(hand, waiting=(2,))
    assert no is not None
    assert "finger_3" in no.reason
    assert "obstacle_1" in no.reason
    assert "move or shrink what is in the way" in no.reason
    assert no.refusal is not None
    assert no.refusal.kind is RefusalKind.NEAR_STANDING
    assert "obstacle_1" in no.refusal.subject
    refused = pipeline.plan(problem)
    assert (refused.status, refused.reason, refused.refusal) == (Status.BLOCKED, no.reason, no.refusal)


def _home(finger: int) -> tuple[float, float, float]:
    hand = pipeline.build_hand(problem := load_problem("hold_two"), pipeline.build_scene(problem))
    x, y, z = hand.p_WF_home[finger].tolist()
    return x, y, z


def test_an_obstacle_in_the_start_posture_is_named() -> None:
    refused = case("obstacle_in_way")
    assert refused.status == "blocked"
    assert "obstacle_1" in refused.reason
    assert "finger_2" in refused.reason
    assert "workspace" not in refused.reason
    assert "move or shrink what is in the way" in refused.reason


def test_an_obstacle_in_the_object_at_its_start_and_at_its_goal() -> None:
    start = plan(obstacles=[sphere(0.0, 0.0, 0.126, 0.003)])
    assert start.status == "blocked"
    assert "obstacle_1 and object/surface" in start.reason
    goal = plan(obstacles=[sphere(0.0, 0.0, 0.11, 0.004)], goal={"translation_m": [0.0, 0.0, -0.014]})
    assert goal.status == "goal_unreachable"
    assert "obstacle_1 and object/surface" in goal.reason
    assert "move or shrink what is in the way" in goal.reason


def test_a_big_ball_whose_fingers_wait_elsewhere_is_planned() -> None:
    """Seventy-five millimetres leave no finger its usual home; a finger that may wait elsewhere is no reason to refuse."""
    assert case("ball_r75").is_solved


def test_a_ball_in_the_floor_is_blocked() -> None:
    refused = plan(object={"radius_m": 0.2})
    assert refused.status == "blocked"
    assert "floor and object/surface" in refused.reason
    assert "friction" not in refused.reason


# -- what is short -------------------------------------------------------------------------------------------------------


def test_joint_ranges_that_leave_no_contacts_are_named(hand: HandModel) -> None:
    lower, upper = hand.fingers[0].chain.lower.copy(), hand.fingers[0].chain.upper.copy()
    lower[0], upper[0] = -0.05, 0.05
    chains = [replace(f.chain, lower=lower, upper=upper) for f in hand.fingers]
    narrow = replace(
        hand,
        fingers=tuple(replace(f, chain=c) for f, c in zip(hand.fingers, chains, strict=True)),
        workspaces=tuple(replace(w, chain=c) for w, c in zip(hand.workspaces, chains, strict=True)),
    )
    refusal = refuse_every_pair(narrow, hand.object.X_WO_home, Admissibility(narrow))
    assert refusal is not None
    assert "joint ranges" in str(refusal)
    assert refusal.kind is RefusalKind.JOINT_LIMIT
    assert refusal.cure == Cure("widen hand.joint_ranges_deg", is_checked=True)
    assert refuse_every_pair(hand, hand.object.X_WO_home, Admissibility(hand)) is None


def test_friction_and_weight_are_told_apart(hand: HandModel) -> None:
    slippery = replace(hand, friction=SoftFinger(0.015, 7e-5))
    refusal = refuse_every_pair(slippery, hand.object.X_WO_home, Admissibility(slippery))
    assert refusal is not None
    assert refusal.kind is RefusalKind.NOT_CLOSED
    assert refusal.cure == Cure("raise the friction, or lower friction.safety", is_checked=True)
    heavy = replace(hand, object=hand.object.weighing(3.0))
    refusal = refuse_every_pair(heavy, hand.object.X_WO_home, Admissibility(heavy))
    assert refusal is not None
    assert refusal.kind is RefusalKind.TOO_HEAVY
    assert refusal.cure == Cure("use a lighter object", is_checked=True)


def test_fingers_that_meet_at_the_start() -> None:
    refused = plan([[20.0, 0.0], [62.0, 0.0], [200.0, 0.0]])
    assert refused.status == "start_inadmissible", refused.reason
    assert "finger_1" in refused.reason
    assert "finger_2" in refused.reason
    assert "raise the friction" not in refused.reason
    assert np.isfinite(refused.X_WO_goal).all()
