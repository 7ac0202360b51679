"""What is asked of a problem without running it: which there are, what the hand can do in one, a plan for it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dexplan import run_folder
from dexplan.commands.asked import CONFIRMED, HONEST_NO, choose_folder, read
from dexplan.commands.output import Output, refusing_unwritable


def list_everything() -> int:
    """Print the built-in problems and scenes, one line each."""
    from dexplan.problems.read import list_problems
    from dexplan.problems.rules import SCENES

    problems = list_problems()
    width = max(map(len, [*problems, *SCENES]))
    for name, summary in problems.items():
        print(f"problem  {name:<{width}}  {summary}")
    for name, facts in SCENES.items():
        print(f"scene    {name:<{width}}  {facts.summary}")
    return CONFIRMED


def inspect(name: str, assignments: Sequence[str], out: Path | None) -> int:
    """Show what the hand can do in a problem: numbers on stdout, a picture in the folder."""
    problem, source = read(name, assignments)
    folder = choose_folder(problem, out)
    output = Output(run_folder.choose_inspect_folder(folder, source, out is not None), problem)
    from dexplan import pipeline

    with output.keeping_evidence(), refusing_unwritable(output.folder):
        findings = pipeline.inspect(problem, output.folder)
    if findings is not None:
        print(findings)
    return CONFIRMED


def plan(name: str, assignments: Sequence[str], out: Path | None) -> int:
    """Plan, save problem and plan, print the plan in words.  A folder that holds a run is not touched."""
    problem, source = read(name, assignments)
    folder = choose_folder(problem, out)
    output = Output(run_folder.choose_plan_folder(folder, source, out is not None), problem)
    from dexplan import pipeline
    from dexplan.viz.timeline import gait_text

    with output.keeping_evidence():
        planned = pipeline.plan(problem)
        output.open()
        planned.save(output.folder / "plan.json")
    print(planned.explain())
    if planned.actions:
        print(gait_text(planned))
    print(f"{planned.status}: {output.folder / 'plan.json'}")
    return CONFIRMED if planned.is_solved else HONEST_NO
