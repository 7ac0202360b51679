"""The start is the grasp that the problem states: tips touch the *true* object with the stated squeeze, whatever is believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from short_runs import HOLD_TIMING, build_plan_reference, hold_problem, plan_of, simulate

from dexplan import pipeline
from dexplan.scene.scene import Scene
from dexplan.sim.record.rollout import Truth

START = replace(HOLD_TIMING, first_hold=0.3, last_hold=0.3)
OFFSETS = {"home": (0.0, 0.0, 0.0), "off": (1e-3, -5e-4, 5e-4)}


def build_world(radius: float, mass: float, tip: float) -> Scene:
    """Return the scene of a hold with the true sizes and mass as shares of the believed ones."""
    problem = hold_problem("hold_12", "firm")
    ball, hand = problem.object, problem.hand
    return pipeline.build_scene(
        replace(
            problem,
            object=replace(ball, radius_m=radius * ball.radius_m, mass_kg=mass * ball.mass_kg),
            hand=replace(hand, tip_radii_m=tuple(tip * r for r in hand.tip_radii_m)),
        )
    )


@pytest.mark.parametrize(
    ("radius", "mass", "tip", "offset"),
    [
        (1.05, 1.0, 1.0, "home"),
        (0.95, 1.0, 1.0, "off"),
        (1.08, 1.2, 1.0, "off"),
        (0.92, 0.8, 1.0, "home"),
        (1.0, 1.0, 1.06, "home"),
        (0.94, 1.0, 0.95, "home"),
    ],
)
def test_tips_start_on_the_true_object(radius: float, mass: float, tip: float, offset: str) -> None:
    problem = hold_problem("hold_12", "firm")
    world = build_world(radius, mass, tip)
    reference = build_plan_reference(problem, plan_of(problem), START)
    X_WO = world.object.X_WO_home.copy()
    X_WO[:3, 3] += OFFSETS[offset]
    trace = simulate(problem, reference, truth=Truth(world, X_WO))
    assert trace.meta["failure"] is None
    held = np.flatnonzero(trace["contact_active"][0])
    assert list(held) == [0, 1]
    first, wanted = (trace[name][0, held, 2] for name in ("contact_force", "contact_force_reference"))
    # Forces are balanced, so a start off its home or a wrong weight changes both, and shares them out otherwise.
    assert first.mean() == pytest.approx(wanted.mean(), rel=0.03)
    ball = trace["qpos"][:, world.object_qpos : world.object_qpos + 3]
    assert np.linalg.norm(ball - X_WO[:3, 3], axis=1).max() < 1.5 * np.linalg.norm(OFFSETS[offset]) + 5e-4


def test_nothing_changes_where_the_world_is_as_believed() -> None:
    problem = hold_problem("hold_12", "firm")
    reference = build_plan_reference(problem, plan_of(problem), START)
    believed = simulate(problem, reference)
    told = simulate(problem, reference, truth=Truth(build_world(1.0, 1.0, 1.0)))
    assert told["qpos"].tobytes() == believed["qpos"].tobytes()
