"""Built-in problems that ask something of their own: the drawn attitude, and the shelf that is really in the way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.errors import ProblemError
from dexplan.planning.admissible.carry import follow_object
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.scene.probe import HandProbe


def test_random_attitudes_come_from_the_seed(tmp_path: Path) -> None:
    goals = [load_problem("any_attitude", {"seed": seed}).goal.orientation_wxyz for seed in (0, 0, 1)]
    assert goals[0] == goals[1] == load_problem("any_attitude").goal.orientation_wxyz
    assert goals[0] != goals[2]
    for goal in goals:
        assert goal is not None
        assert np.linalg.norm(goal) == pytest.approx(1.0)
    # The copy holds numbers, and does not change with another seed.
    path = load_problem("any_attitude", {"seed": 1}).save(tmp_path / "copy.toml")
    assert "random" not in path.read_text().replace("at random", "")
    assert Problem.load(path) == load_problem("any_attitude", {"seed": 1})
    assert load_problem(path, {"seed": 2}).goal.orientation_wxyz == goals[2]


def test_random_attitudes_are_uniform() -> None:
    """The angle of a uniform rotation has density (1 - cos a) / pi, mean pi / 2 + 2 / pi [Shoemake 1992]."""
    w = [load_problem("any_attitude", {"seed": s}).goal.orientation_wxyz for s in range(300)]
    quaternions = np.array(w)
    angles = 2.0 * np.arccos(np.abs(quaternions[:, 0]))
    assert angles.mean() == pytest.approx(np.pi / 2 + 2 / np.pi, abs=4 * angles.std() / np.sqrt(300))
    # The mean of q q^T is a quarter of the identity.
    np.testing.assert_allclose(quaternions.T @ quaternions / 300, np.eye(4) / 4, atol=0.06)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"goal.orientation_wxyz": "randon"},
            "goal.orientation_wxyz: 'randon' does not fit; .* or \"random\"",
        ),
        ({"goal.orientation_wxyz": ["random"]}, "goal.orientation_wxyz"),
        ({"seed": -1}, "seed: -1 is out of range"),
        ({"seed": 0.5}, "seed: 0.5 does not fit"),
        ({"goal.rotation": {"axis": [0, 0, 1], "angle_deg": 90}}, "both rotation and orientation_wxyz"),
    ],
)
def test_bad_random_attitudes(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        load_problem("any_attitude", changes)


def compute_plan_clearance(problem: Problem, plan: Plan) -> tuple[float, str]:
    """Return the least clearance [m] of holding fingers along a plan in the world of ``problem``, and of what."""
    scene = pipeline.build_scene(problem)
    hand, probe = pipeline.build_hand(problem, scene), HandProbe(scene)
    least, names, before = np.inf, "", plan.start_contacts
    postures = {c.finger: c.q for c in before if c is not None}
    for action in plan.actions:
        poses = action.motion.poses() if action.name == "move_object" else action.X_WO_start[None]
        held = [replace(c, q=postures[c.finger]) for c in before if c is not None]
        ways = {c.finger: follow_object(hand, c, poses)[0] for c in held}
        for k, X_WO in enumerate(poses):
            q = hand.q_home.copy()
            for finger, way in ways.items():
                q[finger] = way[k]
            clearance = probe.compute_clearance(q, X_WO, tuple(ways))
            if clearance[0] < least:
                least, names = clearance
        postures = {finger: way[-1] for finger, way in ways.items()}
        before = action.contacts_end
        postures |= {c.finger: c.q for c in before if c is not None and c.finger not in postures}
    return float(least), names


def test_without_the_shelf_the_plan_would_hit_it() -> None:
    # Half of the built-in turn is enough to see it.
    problem = load_problem("shelf", {"goal.rotation.angle_deg": 180.0})
    open_plan, plan = pipeline.plan(replace(problem, obstacles=())), pipeline.plan(problem)
    assert open_plan.is_solved, open_plan.reason
    assert plan.is_solved, plan.reason
    clearance, names = compute_plan_clearance(problem, open_plan)
    assert clearance < -0.005
    assert "obstacle_1" in names
    clearance, names = compute_plan_clearance(problem, plan)
    assert clearance >= 0.002, names
