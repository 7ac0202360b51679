"""What is asked of a problem without running it: which there are, what one says, what the hand can do in it, a plan for it."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from dexplan import run_folder
from dexplan.commands.asked import CONFIRMED, HONEST_NO, check_new_file, choose_folder, read
from dexplan.commands.output import Output, refusing_unwritable, write_new
from dexplan.commands.progress import show_work
from dexplan.commands.voice import conclude, say


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


def show(name: str, assignments: Sequence[str], seed: int | None) -> int:
    """Print a problem as its file with every default written out, and before that, as comments, in words."""
    from dexplan.problems.words import spell_problem

    problem, _ = read(name, assignments, seed)
    say("\n".join(f"# {line}" for line in spell_problem(problem).splitlines()) + "\n")
    conclude(problem.as_toml().rstrip("\n"))
    return CONFIRMED


def new(path: Path) -> int:
    """Write a problem file to start from; nothing that is there is overwritten."""
    from dexplan.problems.template import build_template

    check_new_file(path, ".toml", "a new problem file, such as my_problem.toml")
    write_new(path, build_template(shlex.quote(path.name)))
    conclude(
        f"{path}: a quarter turn, every other key explained; run it with `dexplan run {shlex.quote(str(path))}`"
    )
    return CONFIRMED


def write_schema(path: Path | None) -> int:
    """Print the JSON schema of problem files, or write it into a file of that name, over nothing but an older schema of ours."""
    from dexplan.problems.schema import build_schema_text, is_schema

    text = build_schema_text()
    if path is None:
        conclude(text.rstrip("\n"))
        return CONFIRMED
    if path.is_file() and is_schema(path):
        with refusing_unwritable(path):
            run_folder.write_whole(path, text)
    else:
        check_new_file(path, ".json", "a new file for the schema, such as problem.schema.json")
        write_new(path, text)
    conclude(path)
    return CONFIRMED


def inspect(name: str, assignments: Sequence[str], out: Path | None, seed: int | None = None) -> int:
    """Show what the hand can do in a problem: numbers on stdout, a picture in the folder."""
    problem, source = read(name, assignments, seed)
    folder = choose_folder(problem, out)
    output = Output(run_folder.choose_inspect_folder(folder, source, out is not None), problem)
    from dexplan import pipeline

    with output.keeping_evidence(), refusing_unwritable(output.folder), show_work("inspecting"):
        findings = pipeline.inspect(problem, output.folder)
    if findings is not None:
        say(findings)
    conclude(f"written: {output.folder / 'inspect.png'}")
    return CONFIRMED


def plan(name: str, assignments: Sequence[str], out: Path | None, seed: int | None = None) -> int:
    """Plan, save problem and plan, print the plan in words.  A folder that holds a run is not touched."""
    problem, source = read(name, assignments, seed)
    folder = choose_folder(problem, out)
    output = Output(run_folder.choose_plan_folder(folder, source, out is not None), problem)
    from dexplan import pipeline
    from dexplan.builders import build_margin_limits
    from dexplan.viz.timeline import gait_text

    with output.keeping_evidence():
        with show_work("planning"):
            planned = pipeline.plan(problem)
        output.open()
        planned.save(output.folder / "plan.json")
    say(planned.explain(build_margin_limits(problem)))
    if planned.actions:
        say(gait_text(planned))
    conclude(f"{planned.status}: {output.folder / 'plan.json'}")
    return CONFIRMED if planned.is_solved else HONEST_NO
