"""The run's part of a page: its film, its plan in words with a picture of each action, and its figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

from dexplan.builders import build_margin_limits
from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.names import name_body, name_flats
from dexplan.page.html import Child, as_data_uri, build, build_picture, build_section
from dexplan.page.pictures import Pictures
from dexplan.page.subject import Subject, name_action
from dexplan.plans.margins import MarginLimits, describe_margins, find_tightest
from dexplan.plans.words import describe_goal_contacts, explain_action
from dexplan.viz.body import find_body
from dexplan.viz.story import name_face
from dexplan.viz.summary_panels import describe_briefly
from dexplan.viz.timeline import build_action_spans

TERMS = (
    "A singular posture is one in which a finger cannot move in every direction, as an arm that is stretched out: plans keep "
    "away from it. Where a shorter motion leaves the better next grasp, the object could be taken further, but the finger that "
    "lands next finds a better place from here."
)
"""Two phrases of plans that a newcomer does not know."""
MOST_FILM_BYTES = 8_000_000
"""A longer film stays a file of its own beside the page, so that a page can be sent by mail."""


def build_film(subject: Subject) -> Element | None:
    """Return the film of the run, where one was made."""
    film = subject.folder / "video.mp4"
    if subject.trace is None or not film.is_file():
        return None
    size = film.stat().st_size
    if size > MOST_FILM_BYTES:
        link = build("a", "video.mp4", href="video.mp4")
        return build_section(
            "film", "Film", build("p", "The film is too long to be part of this page: ", link, ".")
        )
    source = as_data_uri(film.read_bytes(), "video/mp4")
    video = build(
        "video", "This browser shows no films.", src=source, controls="", playsinline="", preload="metadata"
    )
    return build_section("film", "Film", video)


def build_plan(subject: Subject, pictures: Pictures, times: dict[int, float]) -> Element | None:
    """Return the plan in words, an entry and a picture per action."""
    plan = subject.plan
    if not plan.actions:
        return None
    spans = {} if subject.trace is None else {s.action_index: s for s in build_action_spans(subject.trace)}
    body = None if subject.trace is None else find_body(subject.trace.model_xml)
    parts: list[Child] = []
    if plan.goal_contacts is not None:
        words = describe_goal_contacts(plan.fingers, plan.goal_contacts)
        parts.append(build("p", f"{words[:1].upper()}{words[1:]}."))
    if plan.speed is not None:
        parts.append(build("p", f"Speed: {plan.speed}."))
    if pictures.by_time:
        words = "Pictures show the end of each action, left the hand and right the object: a cone holds the forces that "
        words += "friction allows, the arrow in it is the force, numbers are fingers"
        words += f"{_tell_faces(body)}."
        parts.append(build("p", words, class_="note"))
    parts.append(build("p", TERMS, class_="note"))
    if pictures.missing:
        parts.append(build("p", f"There are no pictures of the hand: {pictures.missing}", class_="note"))
    entries, before, limits = [], plan.start_contacts, build_margin_limits(subject.problem)
    for k, action in enumerate(plan.actions):
        sentence = explain_action(plan.fingers, action, before)
        span = spans.get(k)
        if span is not None:
            when = f"{span.start:.2f} to {span.end:.2f} s"
        else:
            when = "not reached" if subject.trace is not None else ""
        told = build(
            "div",
            build("h3", f"{k + 1}. {describe_briefly(plan, k)}{name_face(action, body)}"),
            build("p", when, class_="when") if when else None,
            build("p", f"{sentence[:1].upper()}{sentence[1:]}."),
            _build_margins(action.margins, limits),
        )
        picture = pictures.get(times.get(k))
        shown = None
        if picture is not None:
            shown = build_picture(
                picture, f"The hand at the end of action {k + 1}: {describe_briefly(plan, k)}", "jpeg"
            )
        entries.append(build("li", told, shown, id=name_action(k)))
        before = action.contacts_end
    parts.append(build("ol", entries, class_="plan"))
    return build_section("plan", f"The plan in words: {len(plan.actions)} actions", parts)


def _tell_faces(body: ConvexBody | None) -> str:
    """Return what the letters on the object are, where it has any."""
    letters = () if body is None else name_flats(body)
    return f", letters are faces of the {name_body(body)}" if any(letters) else ""


def _build_margins(margins: Mapping[str, float], limits: MarginLimits) -> Element | None:
    """Return what an action leaves to spare at its worst instant, beside its limits, the tightest in bold."""
    described = describe_margins(margins, limits)
    if not described:
        return None
    tightest = find_tightest(described)
    told: list[Child] = []
    for margin in described:
        told += [
            ", " if told else "",
            build("b", f"{margin} (tightest)") if margin is tightest else str(margin),
        ]
    return build("p", "At the worst instant: ", told, class_="note")


def build_figures(subject: Subject) -> Element | None:
    """Return the pictures that stand in the folder of the run."""
    known = {
        "summary.png": "Over time: which finger touches, how hard, how much friction is used, how exactly the object moves; "
        "below, the checks nearest to their limits",
        "refusal.png": "What each finger can touch, which contacts were asked for, and whether friction cones meet",
    }
    name = "refusal.png" if subject.trace is None else "summary.png"
    path = subject.folder / name
    if not path.is_file():
        return None
    return build_section("figures", "Figure", _build_figure(path, known[name]))


def _build_figure(path: Path, words: str) -> Element:
    # On a narrow screen a figure is moved sideways rather than made too small to be read.
    picture = build("div", build_picture(path.read_bytes(), words), class_="wide")
    return build("figure", picture, build("figcaption", f"{words}.", class_="note"))


def build_start(subject: Subject, pictures: Pictures) -> Element | None:
    """Return the hand as it would have started, for a refusal."""
    if not pictures.by_time:
        return None
    _, picture = pictures.by_time[0]
    shown = build_picture(
        picture, "The hand, its object and what stands around it, before anything moves", "jpeg"
    )
    return build_section("scene", "The hand before anything moves", shown)
