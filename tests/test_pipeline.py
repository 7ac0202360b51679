"""From end to end on a small problem: the five verbs, the run folder, and the command line's verdicts and exit codes."""

from __future__ import annotations

import shutil
from pathlib import Path

import mujoco
import numpy as np
import pytest

import dexplan as dx
from dexplan import pipeline
from dexplan.cli import main
from dexplan.errors import RunFolderError

FILES = {"problem.toml", "plan.json", "model.xml", "trace.npz", "report.json"}
TURN = "goal.rotation.angle_deg=60.0"

Run = tuple[dx.Problem, dx.Plan, dx.Trace, dx.ValidationReport]


@pytest.fixture(scope="session")
def problem(tmp_path_factory: pytest.TempPathFactory) -> dx.Problem:
    """A problem from a file of the user's own."""
    path = tmp_path_factory.mktemp("problem") / "sixty.toml"
    path.write_text(
        'format = 1\nname = "sixty"\nscene = "three_finger_sphere"\n'
        '[start]\ncontacts_deg = [[-40.0, 0.0], [104.0, 0.0], "free"]\n'
        '[goal]\nkind = "object_manipulation"\n'
        "rotation = { axis = [0.0, 0.0, 1.0], angle_deg = 60.0 }\n"
    )
    return dx.load_problem(path)


@pytest.fixture(scope="session")
def verbs(problem: dx.Problem) -> Run:
    """What the verbs say."""
    plan = dx.plan(problem)
    trace = dx.rollout(problem, plan)
    return problem, plan, trace, dx.validate(problem, plan, trace)


@pytest.fixture(scope="session")
def saved(verbs: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run folder; tests that change it copy it first."""
    folder = tmp_path_factory.mktemp("run") / "sixty"
    pipeline.save_run(folder, *verbs)
    return folder


@pytest.fixture
def folder(saved: Path, tmp_path: Path) -> Path:
    """A copy of the run folder to change; without its figure, which would be drawn anew with every new verdict."""
    return Path(shutil.copytree(saved, tmp_path / "run", ignore=shutil.ignore_patterns("summary.png")))


def last_line(capsys: pytest.CaptureFixture[str]) -> str:
    """Return the last line on stdout."""
    return capsys.readouterr().out.strip().splitlines()[-1]


# -- Python -----------------------------------------------------------------------------------------------------


def test_verbs_make_a_run_that_passes(verbs: Run) -> None:
    problem, plan, trace, report = verbs
    assert [type(value) for value in verbs] == [dx.Problem, dx.Plan, dx.Trace, dx.ValidationReport]
    assert plan.is_solved
    assert np.degrees(plan.turned_angle) == pytest.approx(60.0)
    assert report.is_passed, report.table()
    assert report.name == problem.name == "sixty"
    assert report["turned_angle"].note.startswith("turned ")
    assert trace.meta["problem"] == "sixty"


def test_values_cannot_be_written(verbs: Run) -> None:
    _, plan, trace, report = verbs
    for array in (trace["qpos"], trace["ctrl"], plan.X_WO_goal, plan.start_contacts[0].point_O):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    for value in (*verbs, report.checks[0]):
        with pytest.raises(AttributeError):
            value.name = "another"
    with pytest.raises(TypeError):
        trace.columns["qpos"] = 0


def test_run_folder_gives_back_what_was_saved(verbs: Run, saved: Path) -> None:
    problem, plan, trace, report = verbs
    assert {path.name for path in saved.iterdir()} >= FILES
    assert not [path.name for path in saved.iterdir() if path.name.startswith(".")]
    again, plan_again, trace_again = pipeline.load_run(saved)
    assert again == problem
    assert plan_again.as_dict() == plan.as_dict()
    assert trace_again == trace
    assert dx.ValidationReport.load(saved / "report.json") == report
    assert (saved / "model.xml").read_text(encoding="utf-8") == trace.model_xml


def test_saved_model_compiles_on_its_own_and_replays(saved: Path) -> None:
    """Nothing but MuJoCo and the folder: the contract's recipe."""
    model = mujoco.MjModel.from_xml_path(str(saved / "model.xml"))
    data = mujoco.MjData(model)
    with np.load(saved / "trace.npz", allow_pickle=False) as trace:
        state, ctrl, qpos = trace["initial_state"], trace["ctrl"], trace["qpos"]
        steps = int(trace["physics_steps_per_sample"])
    mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    for t in range(200):
        assert (data.qpos == qpos[t]).all()
        data.ctrl[:] = ctrl[t]
        mujoco.mj_step(model, data, nstep=steps)


def test_saving_twice_gives_the_same_bytes(verbs: Run, saved: Path, tmp_path: Path) -> None:
    pipeline.save_run(tmp_path, *verbs)
    for name in FILES:
        assert (tmp_path / name).read_bytes() == (saved / name).read_bytes(), name


def test_folder_alone_gives_the_same_checks(verbs: Run, saved: Path) -> None:
    assert dx.validate(*pipeline.load_run(saved)).checks == verbs[3].checks


def test_missing_file_is_named(folder: Path) -> None:
    (folder / "trace.npz").unlink()
    with pytest.raises(RunFolderError, match=r"trace\.npz"):
        pipeline.load_run(folder)


# -- command line -----------------------------------------------------------------------------------------------


def test_run_confirms_a_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["run", "fig4_substitution", "--set", TURN, "--no-video", "--out", str(out)]) == 0
    assert last_line(capsys).startswith("PASS fig4_substitution: ")
    assert {path.name for path in out.iterdir()} >= FILES
    assert dx.ValidationReport.load(out / "report.json").is_passed
    # The folder's copy of the problem is whole: it runs again without the --set.
    assert dx.load_problem(out / "problem.toml").goal.rotation.angle_deg == 60.0


def test_run_fails_on_a_check_and_keeps_the_evidence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    strict = ["--set", "acceptance.penetration_max_um=1.0", "--set", "goal.rotation.angle_deg=5.0"]
    assert main(["run", "fig4_substitution", *strict, "--no-video", "--out", str(out)]) == 1
    assert last_line(capsys).startswith("FAIL penetration_max ")
    assert {path.name for path in out.iterdir()} >= FILES
    report = dx.ValidationReport.load(out / "report.json")
    assert [check.name for check in report.failures] == ["penetration_max"]


def test_run_without_a_plan_is_an_honest_no(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    asked = ["--set", "friction.sliding=0.2", "--set", "friction.torsional_m=0.0005", "--set", TURN]
    assert main(["run", "fig4_substitution", *asked, "--no-video", "--out", str(out)]) == 1
    assert last_line(capsys).startswith(
        "REFUSED start_inadmissible: the start contacts do not hold the object"
    )
    assert {path.name for path in out.iterdir()} == {
        "problem.toml",
        "plan.json",
        "refusal.png",
        "report.html",
    }
    plan = dx.Plan.load(out / "plan.json")
    assert not plan.is_solved
    assert plan.reason


def test_plan_command_writes_the_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "fig4_substitution", "--set", TURN, "--out", str(tmp_path)]) == 0
    assert last_line(capsys).startswith("solved: ")
    assert {path.name for path in tmp_path.iterdir()} == {"problem.toml", "plan.json"}
    assert dx.Plan.load(tmp_path / "plan.json").is_solved


def test_validate_reads_the_folder_only(
    folder: Path,
    verbs: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (folder / "report.json").unlink()
    monkeypatch.chdir(tmp_path)
    assert main(["validate", str(folder)]) == 0
    assert last_line(capsys) == verbs[3].summary_line()
    assert dx.ValidationReport.load(folder / "report.json").checks == verbs[3].checks


def tamper(folder: Path, **changes: object) -> None:
    """Write the folder's trace with columns replaced."""
    trace = dx.Trace.load(folder / "trace.npz")
    dx.Trace(trace.model_xml, {**trace.columns, **changes}, trace.meta).save(folder / "trace.npz")  # type: ignore[dict-item]


def test_edited_controls_do_not_replay(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ctrl = np.array(dx.Trace.load(folder / "trace.npz")["ctrl"])
    ctrl[300, 0] += 1e-9
    tamper(folder, ctrl=ctrl)
    assert main(["validate", str(folder)]) == 1
    assert last_line(capsys).startswith("FAIL replay_matches ")


def test_edited_motion_does_not_replay(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    qpos = np.array(dx.Trace.load(folder / "trace.npz")["qpos"])
    qpos[-1, -7] += 1e-12
    tamper(folder, qpos=qpos)
    assert main(["validate", str(folder)]) == 1
    assert last_line(capsys).startswith("FAIL replay_matches ")


def test_edited_forces_are_not_believed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    force = np.array(dx.Trace.load(folder / "trace.npz")["contact_force"])
    force[100:200, :, :2] *= 0.5
    tamper(folder, contact_force=force)
    assert main(["validate", str(folder)]) == 1
    assert last_line(capsys).startswith("FAIL trace_consistent ")


def test_kinder_gravity_is_found(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trace = dx.Trace.load(folder / "trace.npz")
    assert trace.model_xml.count("<option ") == 1
    kinder = trace.model_xml.replace("<option ", '<option gravity="0 0 -8.81" ')
    dx.Trace(kinder, trace.columns, trace.meta).save(folder / "trace.npz")
    assert main(["validate", str(folder)]) == 1
    capsys.readouterr()
    failures = {c.name: c.note for c in dx.ValidationReport.load(folder / "report.json").failures}
    assert "gravity" in failures["physics_untouched"]
    assert "replay_matches" in failures


def test_another_problem_is_not_answered(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The run is honest, but it is not the answer to what is asked now."""
    text = (folder / "problem.toml").read_text(encoding="utf-8")
    (folder / "problem.toml").write_text(
        text.replace("angle_deg = 60.0", "angle_deg = 90.0"), encoding="utf-8"
    )
    assert main(["validate", str(folder)]) == 1
    capsys.readouterr()
    failures = {c.name for c in dx.ValidationReport.load(folder / "report.json").failures}
    assert {"turned_angle", "rotation_error_final"} <= failures


def test_damaged_folder_is_bad_input(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "plan.json").write_text("{", encoding="utf-8")
    assert main(["validate", str(folder)]) == 2
    said = capsys.readouterr()
    assert "plan.json" in said.err
    assert said.out == ""
