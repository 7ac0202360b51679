"""The page about a run: complete without network or JavaScript, links that lead somewhere, nothing that users wrote as markup."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imsave
from other_bodies import BODIES, swap_trace
from turning_run import make_plan, make_trace

from dexplan import run_folder
from dexplan.errors import RenderError
from dexplan.page import pictures
from dexplan.page.html import as_html, build
from dexplan.page.origin import find_command, list_options
from dexplan.page.pictures import MOST_PICTURES, choose_times
from dexplan.page.report import POLICY, write_report
from dexplan.page.story import MOST_FILM_BYTES
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Cure, Refusal, RefusalKind
from dexplan.plans.status import Status
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.sim.judge.checks_case import CheckResult
from dexplan.sim.judge.validate import CHECKS, ValidationReport
from dexplan.sim.trace import Trace
from dexplan.viz.figure import draw_summary

NASTY = '</style><script>alert("x")</script> & <img src=http://evil.example/x.png onerror=alert(1)> \'"'
BOUND = 15_000_000
"""A page of the longest built-in problem is smaller than this [bytes]."""
VOID = {"meta", "link", "img", "br", "hr", "input", "source"}


class Page(HTMLParser):
    """What stands in a page: tags with their attributes, texts, and whether every element is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.words: list[str] = []
        self.open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] not in ("style", "script"):
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())

    def find(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.tags if name == tag]

    @property
    def anchors(self) -> set[str]:
        return {attributes["id"] for _, attributes in self.tags if "id" in attributes}


def check_page(path: Path) -> Page:
    """Return a page that was read, after checking all that every page has to be."""
    text = path.read_text(encoding="utf-8")
    page = Page(text)
    assert path.stat().st_size < BOUND
    assert text.startswith("<!doctype html>")
    assert not page.open, "every element is closed"
    for tag, attributes in page.tags:
        assert tag not in {"script", "iframe", "object", "embed", "form", "base"}
        assert not [name for name in attributes if name.startswith("on")]
        for name in ("src", "poster", "srcset", "data"):
            assert attributes.get(name, "data:").startswith("data:"), "nothing is loaded from elsewhere"
        if tag == "link":
            assert attributes["href"].startswith("data:")
        if tag == "img":
            assert attributes["alt"]
    (style,) = re.findall("<style>(.*?)</style>", text, re.DOTALL)
    assert "url(" not in style
    assert "@import" not in style
    links = [attributes["href"] for attributes in page.find("a")]
    assert links
    for link in links:
        assert link.removeprefix("#") in page.anchors or link == "video.mp4", link
    ids = Counter(attributes["id"] for _, attributes in page.tags if "id" in attributes)
    assert max(ids.values()) == 1
    policy = [a["content"] for a in page.find("meta") if a.get("http-equiv") == "Content-Security-Policy"]
    assert policy == [POLICY]
    assert run_folder.is_ours(path)
    return page


def _check(name: str, status: str = "pass", value: float | None = 0.1, **given: Any) -> CheckResult:
    return CheckResult(name, status, value, given.pop("limit", 0.5), given.pop("unit", "mm"), **given)  # type: ignore[arg-type]


def make_report(*changed: CheckResult, **given: Any) -> ValidationReport:
    """Return a report with every check passed but those ``changed``."""
    by_name = {check.name: check for check in changed}
    checks = tuple(by_name.get(name, _check(name, worst_time_s=0.3)) for name, _ in CHECKS)
    verdict = "fail" if any(check.status == "fail" for check in checks) else "pass"
    physics, timing = (
        {"profile": "firm", "gravity_m_s2": [0.0, 0.0, -9.81]},
        {"simulated_s": 1.0, "replay_s": 0.123},
    )
    return ValidationReport("x", verdict, checks, physics, timing, {"mujoco": "3.17.0"}, 0, **given)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The moments that were drawn; pictures are grey squares, so that no renderer is needed."""
    moments: list[float] = []

    def draw(
        trace: Trace, times: list[float], folder: str, *, plan: Plan | None = None, options: object
    ) -> tuple[Path, ...]:
        moments.extend(times)
        paths = tuple(Path(folder) / f"{k}.png" for k in range(len(times)))
        for path, time in zip(paths, times, strict=True):
            imsave(path, np.full((8, 8, 3), min(0.5 * time, 1.0)))
        return paths

    monkeypatch.setattr(pictures, "render_frames", draw)
    return moments


@pytest.fixture
def problem() -> Problem:
    return replace(load_problem("hold_three"), summary=NASTY)


@pytest.mark.usefixtures("drawn")
def test_letters_on_a_box_are_explained(tmp_path: Path, problem: Problem) -> None:
    for trace, is_told in ((make_trace(), False), (swap_trace(make_trace(), BODIES["box"]), True)):
        page = check_page(write_report(tmp_path, problem, make_plan(), trace, make_report()))
        assert any("letters are faces of the box" in words for words in page.words) == is_told


def test_a_pass_has_everything(tmp_path: Path, problem: Problem, drawn: list[float]) -> None:
    plan, trace, report = make_plan(), make_trace(), make_report()
    draw_summary(problem.as_dict(), plan, trace, report, tmp_path / "summary.png")
    (tmp_path / "video.mp4").write_bytes(b"a film")
    page = check_page(write_report(tmp_path, problem, plan, trace, report))
    assert "✓ PASS" in page.text
    assert {"verdict", "film", "plan", "figures", "checks", "physics", "origin"} <= page.anchors
    assert {f"action-{k}" for k in range(1, 5)} <= page.anchors
    assert "2. turn +90°" in page.text
    assert page.find("video")[0]["src"].startswith("data:video/mp4;base64,")
    # A picture per action, and the figure.
    assert len(page.find("img")) == 5
    assert NASTY in page.text, "what users write is shown as it is"
    for name, _ in CHECKS:
        assert f"check-{name}" in page.anchors
    assert "0.123" not in page.text, "the judge's own time is no fact of the run"
    assert "mujoco 3.17.0" in page.text
    assert "dexplan run problem.toml" in page.text


def test_the_same_run_gives_the_same_page(tmp_path: Path, problem: Problem, drawn: list[float]) -> None:
    given = problem, make_plan(), make_trace(), make_report()
    first = write_report(tmp_path, *given).read_bytes()
    assert write_report(tmp_path, *given).read_bytes() == first
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_a_failing_check_links_to_its_moment(tmp_path: Path, problem: Problem, drawn: list[float]) -> None:
    report = make_report(
        _check("friction_utilisation_max", "fail", 0.95, limit=0.9, unit="–", worst_time_s=0.42, note=NASTY),
        _check("plan_load_margin", "fail", None),
        _check("creep_rate_max", "not_recorded", None, note="the run has no such column"),
        _check("turned_angle", "not_applicable", None),
        loose_limits={"penetration_max_um": {"value": 400.0, "default": 150.0}},
    )
    page = check_page(write_report(tmp_path, problem, make_plan(), make_trace(), report))
    assert "✗ FAIL" in page.text
    assert 0.42 in drawn
    assert {
        "failures",
        "moment-friction_utilisation_max",
        "moment-plan_load_margin",
        "limits",
    } <= page.anchors
    links = [attributes["href"] for attributes in page.find("a")]
    assert "#moment-friction_utilisation_max" in links
    # The moment lies in the turn, the second action.
    assert "Worst at 0.42 s, in action 2 :" in page.text
    assert "Measured 0.95; the limit is 0.9." in page.text
    assert "– not recorded" in page.text
    assert "1 not applicable, 1 not recorded" in page.text
    assert "penetration_max_um 400 150" in page.text
    assert "limits looser than default (1): penetration_max_um 400 instead of 150" in page.text


def _refuse() -> Plan:
    cause = Refusal(RefusalKind.JOINT_LIMIT, ("finger_1",), 0.01, 0.05)
    cure = Cure("move it <there>", is_checked=True)
    refusal = Refusal(RefusalKind.CANNOT_RELOCATE, ("finger_1",), 0.01, 0.05, cure, (cause,))
    return replace(
        make_plan(), status=Status.NO_GAIT, reason=f"no way & {NASTY}", actions=(), refusal=refusal
    )


def test_a_refusal_says_what_stood_in_the_way(tmp_path: Path, problem: Problem, drawn: list[float]) -> None:
    imsave(tmp_path / "refusal.png", np.zeros((8, 8, 3)))
    page = check_page(write_report(tmp_path, problem, _refuse()))
    assert "⊘ REFUSED no_gait" in page.text
    assert {"refusal", "figures", "scene", "origin"} <= page.anchors
    assert not {"checks", "plan", "film", "physics"} & page.anchors
    assert f"no way & {NASTY}" in page.text
    assert "move it <there> (tried: it helps)" in page.text
    assert "comes within 0.6 deg of its limit" in page.text
    assert len(page.find("img")) == 2


def test_a_machine_that_cannot_draw_has_a_page_all_the_same(
    tmp_path: Path, problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*given: object, **named: object) -> None:
        raise RenderError("no offscreen renderer could be started")

    monkeypatch.setattr(pictures, "render_frames", refuse)
    page = check_page(write_report(tmp_path, problem, make_plan(), make_trace(), make_report()))
    assert not page.find("img")
    assert "There are no pictures of the hand: no offscreen renderer could be started" in page.text


def test_a_long_film_stays_beside_the_page(tmp_path: Path, problem: Problem, drawn: list[float]) -> None:
    (tmp_path / "video.mp4").write_bytes(bytes(MOST_FILM_BYTES + 1))
    page = check_page(write_report(tmp_path, problem, make_plan(), make_trace(), make_report()))
    assert not page.find("video")
    assert "video.mp4" in [attributes["href"] for attributes in page.find("a")]


def test_a_long_plan_shows_fewer_pictures() -> None:
    plan, trace = make_plan(), make_trace(duration=8.0)
    assert choose_times(trace, plan) == {
        k: pytest.approx(t, abs=0.021) for k, t in enumerate((1.98, 5.98, 7.18, 8.0))
    }
    many = replace(plan, actions=plan.actions * 50)
    columns = {**trace.columns, "action_index": np.arange(trace.sample_count) // 2}
    times = choose_times(Trace(trace.model_xml, columns, trace.meta), many)
    assert MOST_PICTURES // 2 < len(times) <= MOST_PICTURES + 1
    assert max(times) == 199


def test_the_command_is_the_shortest_that_makes_the_run_again() -> None:
    built_in = load_problem("hold_three")
    assert find_command(built_in) == "dexplan run hold_three"
    assert find_command(replace(built_in, seed=5)) == "dexplan run hold_three --seed 5"
    assert find_command(replace(built_in, summary="another")) == "dexplan run problem.toml"
    assert find_command(replace(built_in, name="mine")) == "dexplan run problem.toml"


def test_a_world_that_was_not_as_believed_and_another_controller_stand_in_the_command() -> None:
    report = make_report(recorded={"controller": "my arm"})
    assert list_options(report) == ["--controller FILE.py:NAME"]
    assert list_options(None) == []
    untrue = {
        "friction.sliding": {"believed": 0.5, "true": 0.4},
        "obstacles": {"believed": [], "true": [{"kind": "box"}]},
    }
    known = SimpleNamespace(recorded={}, as_dict=lambda: {"untrue": untrue})
    assert list_options(known) == ["--true friction.sliding=0.4", """--true 'obstacles=[{"kind" = "box"}]'"""]  # type: ignore[arg-type]


def test_a_run_without_planned_forces_has_a_page(
    tmp_path: Path, problem: Problem, drawn: list[float]
) -> None:
    full = make_trace()
    columns = {name: column for name, column in full.columns.items() if name != "contact_force_reference"}
    trace = Trace(full.model_xml, columns, full.meta)
    report = make_report(_check("friction_utilisation_max", "fail", 0.95, limit=0.9, worst_time_s=0.42))
    draw_summary(problem.as_dict(), make_plan(), trace, report, tmp_path / "summary.png")
    page = check_page(write_report(tmp_path, problem, make_plan(), trace, report))
    assert "finger 1 yes 5 N" in page.text


def test_text_is_never_markup() -> None:
    element = build("p", "a", build("b", "<i>"), "\x00&", class_="x\"y'", title=None)
    assert as_html(element) == '<p class="x&quot;y\'">a<b>&lt;i&gt;</b>\N{REPLACEMENT CHARACTER}&amp;</p>'
    assert as_html(build("img", src="data:,")) == '<img src="data:,">'
