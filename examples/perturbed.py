"""Carry a plan out in a world that is not what planner and controller were told: runs/turn with another ball."""

import dexplan as dx

problem = dx.load_problem("turn.toml")
plan = dx.Plan.load("runs/turn/plan.json")

# The truth: a ball 10 % heavier, friction 5 % lower, and 0.2 mm lower than expected at the start.
world = dx.load_problem(
    "turn.toml", {"object.mass_kg": 0.0495, "friction.sliding": 0.5225, "friction.torsional_m": 0.002375}
)
X_WO = plan.X_WO_start.copy()
X_WO[:3, 3] += [0.0, 0.0, -0.0002]

trace = dx.rollout(problem, plan, world=world, X_WO_start=X_WO)
report = dx.validate(problem, plan, trace, world=world)  # judged by what is true
print(report.verdict)
for name in ("position_error_max", "position_error_final", "friction_utilisation_max", "coulomb_slip_max"):
    check = report[name]
    print(f"{name}: {check.status}, {check.value:.3f} of {check.limit} {check.unit}")
