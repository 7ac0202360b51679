"""Plan, simulate and judge a built-in problem in Python: the five verbs."""

import dexplan as dx

problem = dx.load_problem("fig4_substitution", {"goal.rotation.angle_deg": 30.0})
plan = dx.plan(problem)
print(plan.status)
for number, action in enumerate(plan.actions, start=1):
    print(number, action.name, [plan.fingers[finger] for finger in action.grasping])

trace = dx.rollout(problem, plan)  # MuJoCo, closed loop
print(f"{trace['time'][-1]:.2f} s, {trace.sample_count} samples")

report = dx.validate(problem, plan, trace)  # replays the run and judges it
print(report.verdict)
error = report["position_error_max"]
print(f"off its reference by {error.value:.4f} {error.unit} at most; {error.limit} are allowed")
