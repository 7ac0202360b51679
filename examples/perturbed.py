"""Carry a plan out in a world that is not what planner and controller were told: runs/turn with another ball."""

from dataclasses import replace

import dexplan as dx
from dexplan.pipeline import build_scene

problem = dx.load_problem("turn.toml")
plan = dx.Plan.load("runs/turn/plan.json")

# The truth: a ball 10 % heavier, friction 5 % lower, and 0.2 mm lower than expected at the start.
friction = problem.friction
truth = replace(
    problem,
    object=replace(problem.object, mass_kg=1.10 * problem.object.mass_kg),
    # Planner and controller go on believing in sliding / safety, and torsional / safety.
    friction=replace(
        friction,
        sliding=0.95 * friction.sliding,
        torsional_m=0.95 * friction.torsional_m,
        safety=0.95 * friction.safety,
    ),
)
world = build_scene(truth)
X_WO = world.object.X_WO_home.copy()
X_WO[:3, 3] += [0.0, 0.0, -0.0002]

trace = dx.rollout(problem, plan, true_scene=world, X_WO_start=X_WO)
report = dx.validate(truth, plan, trace)  # judged by what is true
print(report.verdict)
for name in ("position_error_max", "position_error_final", "friction_utilisation_max", "coulomb_slip_max"):
    check = report[name]
    print(f"{name}: {check.status}, {check.value:.3f} of {check.limit} {check.unit}")
