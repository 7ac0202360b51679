"""When ``dexplan`` writes report.html: with every run and every refusal, again with a new verdict or film, never unasked."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from fake_run import PAGE, FakePlan, FakeReport, make_older_run

from dexplan import run_folder
from dexplan.cli import main
from dexplan.pipeline import draw_refusal, write_report
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.problems.read import load_problem
from dexplan.viz import video


@pytest.fixture
def told(pipeline: SimpleNamespace) -> list[tuple[object, ...]]:
    """What each page was made of."""
    given: list[tuple[object, ...]] = []
    write = pipeline.write_report

    def spy(folder: Path, *values: object) -> None:
        given.append(values)
        write(folder, *values)

    pipeline.write_report = spy
    return given


def test_a_run_leaves_its_page_unless_told_not_to(told: list[tuple[object, ...]], cwd: Path) -> None:
    assert main(["run", "hold_two", "--out", "a"]) == 0
    assert (cwd / "a/report.html").read_text() == PAGE
    assert len(told[0]) == 4
    assert main(["run", "hold_two", "--out", "b", "--no-report"]) == 0
    assert not (cwd / "b/report.html").exists()
    # A page of an older run does not outlive that run.
    assert main(["run", "hold_two", "--out", "a", "--no-report"]) == 0
    assert not (cwd / "a/report.html").exists()


def test_a_refusal_leaves_a_picture_and_a_page(
    told: list[tuple[object, ...]], pipeline: SimpleNamespace, cwd: Path
) -> None:
    pipeline.plan = lambda problem: FakePlan("no_gait")
    assert main(["run", "hold_two", "--out", "a"]) == 1
    assert sorted(path.name for path in (cwd / "a").iterdir()) == [
        "plan.json",
        "problem.toml",
        "refusal.png",
        "report.html",
    ]
    assert len(told[0]) == 2
    assert main(["run", "hold_two", "--out", "b", "--no-report"]) == 1
    assert (cwd / "b/refusal.png").exists()
    assert not (cwd / "b/report.html").exists()


def test_the_answer_is_told_where_the_page_cannot_be_written(
    pipeline: SimpleNamespace, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    def fail(*given: object) -> None:
        raise OSError(28, "No space left on device", str(cwd / "a/report.html"))

    pipeline.write_report = fail
    assert main(["run", "hold_two", "--out", "a"]) == 2
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == "PASS all"
    assert "No space left" in err


def test_a_new_verdict_renews_the_page_that_is_there(
    told: list[tuple[object, ...]], pipeline: SimpleNamespace, cwd: Path
) -> None:
    make_older_run(cwd / "a")
    pipeline.draw_run = lambda *given: None
    pipeline.validate_as_recorded = lambda problem, plan, trace: FakeReport("fail")
    assert main(["validate", "a"]) == 1
    assert len(told) == 1
    (cwd / "a/report.html").unlink()
    assert main(["validate", "a"]) == 1
    assert len(told) == 1, "a run without a page stays without one"


def test_a_page_of_somebody_else_is_left_alone(cwd: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (cwd / "a").mkdir()
    (cwd / "a/report.html").write_text("<!doctype html><html><head><title>mine</title></head></html>")
    assert not run_folder.is_ours(cwd / "a/report.html")
    assert main(["run", "hold_two", "--out", "a"]) == 2
    assert "report.html" in capsys.readouterr().err


def test_the_pipeline_draws_and_tells_a_refusal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The real thing, but for the renderer: contacts that are too far from opposite hold nothing."""
    from dexplan import pipeline

    monkeypatch.setattr(video, "BACKENDS", ())
    contacts = {"start.contacts_deg": [[0.0, 0.0], [110.0, 0.0], "free"]}
    problem = load_problem("hold_two", contacts)
    plan = pipeline.plan(problem)
    assert isinstance(plan, Plan)
    assert plan.status is Status.START_INADMISSIBLE
    assert run_folder.is_ours(draw_refusal(tmp_path, problem, plan))
    page = write_report(tmp_path, problem, plan)
    assert run_folder.is_ours(page)
    assert "REFUSED start_inadmissible" in page.read_text(encoding="utf-8")
    assert not run_folder.find_run_files(tmp_path), "a refusal is no run"
