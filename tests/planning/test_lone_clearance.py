"""One finger's clearance, remembered by direction: what the probe says, whoever asked what before."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.icosphere import build_icosphere
from dexplan.kinematics.spherical_wrist import solve_tip_pose
from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.admissible.aligned import build_aligned
from dexplan.planning.admissible.conditions import refuse_nearness
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.lone_clearance import LEVEL, LoneClearance, remember_clearances
from dexplan.plans.refusal import Refusal
from dexplan.problems.read import load_problem
from dexplan.spatial import Array, make_pose

SHELF = {"kind": "box", "pos_m": [0.075, -0.03, 0.136], "size_m": [0.002, 0.06, 0.002]}


@pytest.fixture(scope="module")
def barred() -> HandModel:
    """Return the hand with a bar that some contacts of finger 1 are too near to."""
    problem = load_problem("fig4_substitution", {"obstacles": [SHELF]})
    return pipeline.build_hand(problem, pipeline.build_scene(problem))


def probe(hand: HandModel, finger: int, center: Array, normal: Array, gap: float) -> Refusal | None:
    """Return what the probe itself says of the finger at ``gap`` [m] over the ball, the others away; None out of reach."""
    X = build_aligned(hand, finger, center, normal[None])
    X[:, :3, 3] += gap * normal
    q, reached = solve_tip_pose(hand.workspaces[finger], X)
    if not reached[0]:
        return None
    posture = hand.q_home.copy()
    posture[finger] = q[0]
    touching, others = () if gap else (finger,), tuple({0, 1, 2} - {finger})
    nearest, needed = (
        hand.probe.find_nearest(posture, make_pose(p=center), touching, others),
        hand.limits.clearance,
    )
    return refuse_nearness(nearest, needed) if nearest.distance < needed else None


def test_directions_of_the_grid_get_the_probe_s_own_answer(barred: HandModel) -> None:
    finger, center, normals = 0, barred.object.X_WO_home[:3, 3], build_icosphere(LEVEL).vertices[::11]
    lone = LoneClearance(barred)
    touch, land = lone.refuse_contact(finger, center, normals), lone.refuse_landing(finger, center, normals)
    exact = [probe(barred, finger, center, n, 0.0) for n in normals]
    over = [probe(barred, finger, center, n, barred.hover) for n in normals]
    assert touch == exact
    assert land == [a or b for a, b in zip(exact, over, strict=True)]
    assert any(refusal is not None and "obstacle_1" in refusal.subject for refusal in touch)
    # Somewhere a finger may stand but not come from.
    assert any(b and not a for a, b in zip(touch, land, strict=True))


def test_other_directions_get_the_answer_of_the_nearest_of_the_grid(barred: HandModel) -> None:
    center, asked = barred.object.X_WO_home[:3, 3], spread_directions(200)
    vertices = build_icosphere(LEVEL).vertices
    nearest = vertices[(asked @ vertices.T).argmax(axis=1)]
    assert (asked * nearest).sum(axis=1).min() > np.cos(np.radians(3.5))
    lone = LoneClearance(barred)
    assert lone.refuse_contact(0, center, asked) == lone.refuse_contact(0, center, nearest)


def test_answers_do_not_depend_on_what_was_asked_before(barred: HandModel) -> None:
    """One after the other, backwards, all at once, after other fingers and places: the same."""
    home, asked = barred.object.X_WO_home[:3, 3], spread_directions(45)
    other = home + np.array([0.004, -0.003, 0.006])
    at_once = {
        (f, k): LoneClearance(barred).refuse_landing(f, center, asked)
        for f in (0, 2)
        for k, center in enumerate((home, other))
    }
    assert at_once[0, 0] != at_once[0, 1]
    assert at_once[0, 0] != at_once[2, 0]
    lone = LoneClearance(barred)
    lone.refuse_contact(0, other, asked[:7])
    answers: dict[tuple[int, int], list[Refusal | None]] = {key: [None] * len(asked) for key in at_once}
    order = np.random.default_rng(3).permutation(len(asked))
    for j in order.tolist():
        for f, k in reversed(at_once):
            answers[f, k][j] = lone.refuse_landing(f, (home, other)[k], asked[j : j + 1])[0]
    assert answers == at_once


def test_a_hand_has_one_memo(hand: HandModel, barred: HandModel) -> None:
    assert remember_clearances(hand) is remember_clearances(hand)
    assert remember_clearances(hand) is not remember_clearances(barred)
    nothing = LoneClearance(hand).refuse_landing(0, hand.object.X_WO_home[:3, 3], np.zeros((0, 3)))
    assert nothing == []
