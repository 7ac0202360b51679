"""``report.html``: one file that says what was asked, what came of it, and why one may believe it."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from dexplan.builders import build_scene
from dexplan.page.html import Child, as_html, build
from dexplan.page.judgement import (
    build_checks,
    build_failures,
    build_loose_limits,
    build_refusal,
    build_verdict,
    list_moments,
)
from dexplan.page.origin import build_origin, build_physics
from dexplan.page.pictures import MOMENT, SCENE, Pictures, choose_times, draw_pictures
from dexplan.page.story import build_figures, build_film, build_plan, build_start
from dexplan.page.subject import Subject
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.problems.problem import Problem
from dexplan.run_folder import MARK, PAGE, write_whole
from dexplan.sim.judge.report import ValidationReport
from dexplan.sim.trace import Trace
from dexplan.viz.curves import Curves, compute_curves
from dexplan.viz.figure import describe_goal

POLICY = "default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'"
"""What a browser may load for the page: nothing but what is in it."""
TITLES = {
    "failures": "What failed",
    "refusal": "Why",
    "scene": "Hand",
    "film": "Film",
    "plan": "Plan",
    "figures": "Figure",
    "checks": "Checks",
    "limits": "Loosened limits",
    "physics": "Physics",
    "origin": "Make it again",
}
"""What the links at the top are called, by section."""


def write_report(
    folder: str | Path,
    problem: Problem,
    plan: Plan,
    trace: Trace | None = None,
    report: ValidationReport | None = None,
) -> Path:
    """Write ``report.html`` into the folder of a run, whole or not at all; return its path.

    Summary, refusal picture and film are taken from the folder where they are there. Without ``trace`` and ``report`` the page is
    about a refusal.
    """
    path = Path(folder) / PAGE
    scene = _show_start(problem, plan) if trace is None else None
    write_whole(path, render_page(Subject(Path(folder), problem, plan, trace, report, scene)))
    return path


def _show_start(problem: Problem, plan: Plan) -> Trace:
    """Return a trace of one sample: the hand at home around the object where it starts."""
    scene = build_scene(problem)
    qpos = scene.as_qpos(np.stack([finger.q_home for finger in scene.fingers]), plan.X_WO_start)
    return Trace(scene.xml, {"time": np.zeros(1), "qpos": qpos[None]}, {})


def render_page(subject: Subject) -> str:
    """Return the page as HTML text; the same subject gives the same text."""
    times: dict[int, float] = {}
    curves: Curves | None = None
    if subject.trace is None:
        pictures = Pictures() if subject.scene is None else draw_pictures(subject.scene, None, [0.0], SCENE)
        shown = [build_figures(subject), build_start(subject, pictures)]
        # What is in the way is seen in the scene, what is out of reach in the figure.
        is_blocked = subject.plan.status is Status.BLOCKED
        sections = [build_refusal(subject), *(reversed(shown) if is_blocked else shown)]
    else:
        times, moments = choose_times(subject.trace, subject.plan), list_moments(subject)
        pictures = draw_pictures(subject.trace, subject.plan, list(times.values()))
        told = draw_pictures(subject.trace, subject.plan, list(moments.values()), MOMENT)
        curves = compute_curves(subject.data, subject.plan, subject.trace)
        sections = [build_failures(subject, told, curves), build_film(subject)]
    sections.append(build_plan(subject, pictures, times))
    if subject.trace is not None:
        sections += [build_figures(subject), build_checks(subject), build_loose_limits(subject.report)]
    sections += [build_physics(subject), build_origin(subject)]
    filled = [section for section in sections if section is not None]
    return "<!doctype html>\n" + as_html(_frame(subject, filled)) + "\n"


def _frame(subject: Subject, sections: list[Element]) -> Element:
    """Return the whole page around its sections."""
    name, style = (
        subject.problem.name,
        resources.files("dexplan.page").joinpath("style.css").read_text(encoding="utf-8"),
    )
    head = build(
        "head",
        build("meta", charset="utf-8"),
        build("meta", http_equiv="Content-Security-Policy", content=POLICY),
        build("meta", name="viewport", content="width=device-width, initial-scale=1"),
        build("meta", name="generator", content=MARK),
        # An empty icon, so that no browser asks for one.
        build("link", rel="icon", href="data:,"),
        build("title", f"{name}: {_spell_answer(subject)}"),
        build("style", style),
    )
    links = [build("a", TITLES[section.get("id", "")], href=f"#{section.get('id')}") for section in sections]
    summary: Child = build("p", subject.problem.summary) if subject.problem.summary else None
    body = build(
        "body",
        build("header", build("h1", name), build("p", describe_goal(subject.plan), class_="goal"), summary),
        build_verdict(subject),
        build("nav", links, aria_label="Sections of this page"),
        build("main", sections),
        build("footer", build("p", "Made by dexplan; judged by replay in MuJoCo.")),
    )
    return build("html", head, body, lang="en")


def _spell_answer(subject: Subject) -> str:
    if subject.report is None:
        return f"refused, {subject.plan.status}"
    return "pass" if subject.report.is_passed else "fail"
