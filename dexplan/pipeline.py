"""The five verbs: from a problem to a plan, a trace, a judgement and a film.  Each is a thin line between rooms."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from dexplan.builders import (  # noqa: F401 - callers find them all here
    build_allowed_regions,
    build_friction,
    build_goals,
    build_hand,
    build_improvement,
    build_limits,
    build_margin_limits,
    build_options,
    build_scene,
    build_squeeze,
    build_timing,
)
from dexplan.control.foreign import ForeignController
from dexplan.control.options import ControlOptions
from dexplan.control.reference import build_reference
from dexplan.errors import DexplanError
from dexplan.planning.actions import schedule
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.search.options import SearchOptions
from dexplan.planning.tasks.blocked import find_obstruction
from dexplan.planning.tasks.dextrous_manipulation import plan_dextrous_manipulation
from dexplan.planning.tasks.fixed_contacts import plan_fixed_contacts
from dexplan.planning.tasks.grasp_adjustment import plan_grasp_adjustment
from dexplan.planning.tasks.object_manipulation import refuse
from dexplan.planning.tasks.rolling_start import plan_object_manipulation
from dexplan.planning.tasks.starting import Start
from dexplan.planning.tasks.waypoints import plan_waypoints
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.plans.timing import Timing
from dexplan.problems import as_run
from dexplan.problems.problem import Problem, compute_contact_directions
from dexplan.problems.true_world import check_world, read_recorded_world
from dexplan.run_folder import RUN_FILES, check_replaceable, drop_told, read_model, save_problem, write_whole
from dexplan.scene.scene import Scene
from dexplan.sim.judge.true_world import join_world
from dexplan.sim.judge.validate import ValidationReport, validate_run
from dexplan.sim.judge.world import read_world
from dexplan.sim.record import rollout as _rollout
from dexplan.sim.record.keyframes import name_states
from dexplan.sim.trace import Trace, check_replayable
from dexplan.spatial import Array
from dexplan.viz.film import CAMERAS, FPS, SIZE, Film, FilmOptions
from dexplan.viz.story import build_captions

_LOG = logging.getLogger(__name__)


def plan(problem: Problem) -> Plan:
    """Return a plan for ``problem``; "no plan" is a status with its reason, not an exception."""
    scene = build_scene(problem)
    hand = build_hand(problem, scene)
    _LOG.info("looking for a plan")
    return time_plan(problem, _find_plan(problem, scene, hand))


def time_plan(problem: Problem, plan: Plan, timing: Timing | None = None) -> Plan:
    """Return ``plan`` with the arcs of its fingers and all durations written in, so that it can be run.

    Plans come timed from :func:`plan`; one that was put together by hand has to be timed.  ``timing`` replaces the problem's.
    """
    return schedule.time_plan(plan, build_scene(problem).fingers, timing or build_timing(problem))


def _find_plan(problem: Problem, scene: Scene, hand: HandModel) -> Plan:
    """Return the plan of the room that answers the goal's kind."""
    X_WO, asked = scene.object.X_WO_home, problem.goal
    goals = build_goals(problem, X_WO)
    goal = goals[0]
    if refusal := build_squeeze(problem, scene).refusal:
        reason = f"{refusal}; {refusal.cure}"
        plan = refuse(hand, goal, Status.OBJECT_TOO_LIGHT, reason, refusal)
        return replace(plan, goal_kind=asked.kind)
    contacts = problem.start.contacts_deg
    start = None if isinstance(contacts, str) else compute_contact_directions(contacts)
    waiting = None if start is None else tuple(f for f, normal in enumerate(start) if normal is None)
    if no := find_obstruction(hand, waiting):
        return replace(refuse(hand, goal, no.status, no.reason, no.refusal), goal_kind=asked.kind)
    means = (problem.gait.node_budget, problem.gait.primitives)
    options = SearchOptions(*means, build_improvement(problem))
    if asked.contacts_deg is None:

        def plan_one(goal: RotationGoal, start: Start) -> Plan:
            if not problem.gait.primitives:
                return plan_fixed_contacts(hand, goal, start, problem.gait.node_budget)
            return plan_object_manipulation(hand, goal, start, *means, options.improvement)

        return plan_one(goal, start) if len(goals) == 1 else plan_waypoints(hand, goals, start, plan_one)
    wanted = compute_contact_directions(asked.contacts_deg)
    if asked.kind == "grasp_adjustment":
        return plan_grasp_adjustment(hand, X_WO, start, wanted, options, asked.keep_object)
    timing = build_timing(problem)
    return plan_dextrous_manipulation(
        hand,
        goal,
        start,
        wanted,
        options,
        order=asked.order,
        compute_duration=lambda found: schedule.time_plan(found, scene.fingers, timing).duration,
    )


def rollout(
    problem: Problem,
    plan: Plan,
    *,
    controller: ForeignController | None = None,
    world: Problem | None = None,
    X_WO_start: Array | None = None,
    options: ControlOptions | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trace:
    """Run ``plan`` in MuJoCo, closed loop; a failure still returns the trace so far.

    Args:
        problem: what planner and controller believe.
        plan: a plan with actions and durations; one that only holds the object will do.
        controller: takes the place of dexplan's own: a function ``step(observation) -> ctrl``, or an object with that method and,
            where it wants one, ``reset(start)``; see :mod:`dexplan.control.foreign`.
        world: a problem with the true friction, mass and sizes, which nobody is told (None: those of ``problem``).
        X_WO_start: (4, 4) the object's true pose at the start (None: its home).
        options: replace those of dexplan's own controller (ablations); another one is asked at their rate.
        progress: called with the share done.

    Returns:
        The run.  ``world`` and the name of a ``controller`` stand in its ``meta``.

    Raises:
        DexplanError: The plan has no actions, or no durations.
        ControllerError: ``controller`` is none, raised something, or answered what is no control.
        ProblemError: ``world`` differs from ``problem`` in more than the world's parameters.

    An exception that cuts the run short, Ctrl-C included, carries what was recorded as its attribute ``trace``.
    """
    if not plan.actions:
        raise DexplanError(
            f"the plan has no actions to run ({plan.status}: {plan.reason}); a solved plan is accepted"
        )
    if not plan.is_timed:
        raise DexplanError(
            "the plan does not say how fingers travel and how long its actions take, as plan.json of format 1 did not; "
            "plan again: `dexplan plan` and `dexplan run` write format 2"
        )
    if world is not None:
        check_world(problem, world)
    scene = build_scene(problem)
    true_scene = None if world is None else build_scene(world)
    trace = _rollout.rollout(
        scene,
        build_reference(plan),
        options or build_options(problem),
        controller=controller,
        truth=_rollout.Truth(true_scene, X_WO_start),
        meta={
            "problem": problem.name,
            "seed": problem.seed,
            "captions": build_captions(plan, scene.object.body),
            **as_run.describe_run(problem, plan.as_dict(), world),
        },
        progress=progress,
    )
    return name_states(trace, plan, true_scene or scene)


def validate(
    problem: Problem,
    plan: Plan,
    trace: Trace,
    *,
    world: Problem | None = None,
    groups: Iterable[str] | None = None,
) -> ValidationReport:
    """Judge a run by replaying it; uses problem and plan as data only.

    ``world`` is the problem with the true parameters that the run was made with, where those are not what ``problem`` believes.
    ``groups`` names the groups of checks to judge, of "physics", "task", "contacts", "forces", "internals" (None: all); the
    verdict line tells which.  Of a run by another controller than dexplan's own the internals are "not recorded".

    Raises RunFolderError for a trace that is none, UnknownNameError for no group, ProblemError for a ``world`` that differs in
    more than the world's parameters, and for ``groups`` of which nothing is recorded.
    """
    check_replayable(trace, "the trace")
    if world is not None:
        check_world(problem, world)
    true = None if world is None else world.as_dict()
    return validate_run(problem.as_dict(), plan.as_dict(), trace, groups=groups, world=true)


def validate_as_recorded(problem: Problem, plan: Plan, trace: Trace) -> ValidationReport:
    """Judge a saved run, with the true world that its record names; the report says in what that differs from ``problem``."""
    check_replayable(trace, "the trace")
    world = read_recorded_world(problem, trace.meta)
    return validate_run(problem.as_dict(), plan.as_dict(), trace, world=world)


def render(
    trace: Trace,
    path: str | Path,
    plan: Plan | None = None,
    *,
    cameras: Sequence[str] = CAMERAS,
    size: tuple[int, int] = SIZE,
    fps: float = FPS,
    quality: str = "normal",
) -> Film:
    """Film a trace offscreen, in a process of its own, into a ``.mp4`` or ``.gif``; return the film, which a notebook shows.

    The trace carries its words; a ``plan`` tells them anew.  ``cameras``: one or two, side by side, of ``overview``,
    ``closeup``, ``top``, ``side``; ``size``: width and height [pixels]; ``quality``: ``draft``, ``normal`` or ``fine``.
    Raises RenderError where no renderer can be started, and for any other suffix; FilmOptionError for options that make no film.
    """
    from dexplan.viz.video import render_video

    return render_video(trace, plan, Path(path), FilmOptions(size, tuple(cameras), fps, quality))


def render_run(
    folder: str | Path,
    path: str | Path | None = None,
    options: FilmOptions | None = None,
    progress: Callable[[float], None] | None = None,
) -> Film:
    """Film a saved run into its ``video.mp4``, or into ``path``; return the film."""
    from dexplan.viz.video import render_run as film

    return film(Path(folder), options, path=path, progress=progress)


def save_run(
    folder: str | Path, problem: Problem, plan: Plan, trace: Trace, report: ValidationReport | None = None
) -> Path:
    """Write the run folder: problem, plan, model, trace, and with a report this and the summary figure.  Returns the folder.

    What an older run left there is replaced.  Raises RunFolderError, before anything is written, where a file in the way was made
    by no run.
    """
    folder = Path(folder)
    for name in RUN_FILES:
        check_replaceable(folder / name)
    folder.mkdir(parents=True, exist_ok=True)
    save_problem(problem, folder / "problem.toml")
    plan.save(folder / "plan.json")
    write_whole(folder / "model.xml", trace.model_xml)
    trace.save(folder / "trace.npz")
    drop_told(folder)
    if report is None:
        return folder
    report.save(folder / "report.json")
    draw_run(folder, problem, plan, trace, report)
    return folder


def draw_run(
    folder: str | Path, problem: Problem, plan: Plan, trace: Trace, report: ValidationReport
) -> None:
    """Draw the summary figure of a run into its folder, with the friction that was true."""
    from dexplan.viz.figure import draw_summary

    true = join_world(problem.as_dict(), read_recorded_world(problem, trace.meta))
    draw_summary(true, plan, trace, report, Path(folder) / "summary.png")


def write_report(
    folder: str | Path,
    problem: Problem,
    plan: Plan,
    trace: Trace | None = None,
    report: ValidationReport | None = None,
) -> Path:
    """Write ``report.html``, one page with everything, into a run folder; without ``trace`` and ``report`` about a refusal."""
    from dexplan.page.report import write_report as write

    return write(folder, problem, plan, trace, report)


def draw_refusal(folder: str | Path, problem: Problem, plan: Plan) -> Path:
    """Draw what the hand can reach and hold of what a refused problem asks, ``refusal.png``; return its path."""
    from dexplan.viz.refusal import draw_refused_problem

    return draw_refused_problem(problem, plan, Path(folder) / "refusal.png")


class SavedRun(NamedTuple):
    """What a run folder holds; ``validate(*run)`` judges it again."""

    problem: Problem
    plan: Plan
    trace: Trace


def load_run(folder: str | Path) -> SavedRun:
    """Return the problem, plan and trace of a run folder.  Raises RunFolderError for anything else.

    What the files say against each other goes with the trace, for the judge: a folder that cannot be read is refused, a
    folder that contradicts itself is judged, and fails.
    """
    folder = Path(folder)
    problem = Problem.load(folder / "problem.toml")
    plan = Plan.load(folder / "plan.json")
    model_xml = read_model(folder / "model.xml")
    trace = Trace.load(folder / "trace.npz")
    check_replayable(trace, str(folder / "trace.npz"))
    as_run.check_whole(folder / "problem.toml", trace.meta)
    written = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    found = list(as_run.find_differences(folder / "problem.toml", written, trace.meta))
    if model_xml != trace.model_xml:
        read_world(model_xml)
        found.append("model.xml and the model in trace.npz are not the same text")
    return SavedRun(problem, plan, replace(trace, contradictions=tuple(found)))


def inspect(problem: Problem, folder: str | Path | None = None) -> str:
    """Return what the hand can do in ``problem``, as text: what fingers reach, which pairs hold, how much they carry.

    With a ``folder`` it is also drawn there, as ``inspect.png``.  Raises RunFolderError where such a picture is there that is not
    ours.
    """
    from dexplan.viz.maps import describe_reach, draw_reach

    scene = build_scene(problem)
    hand = build_hand(problem, scene)
    if folder is not None:
        picture = Path(folder) / "inspect.png"
        check_replaceable(picture)
        picture.parent.mkdir(parents=True, exist_ok=True)
        draw_reach(hand, picture)
    return describe_reach(hand)
