"""The rest of the public API: runs and problems as values of Python, tables, what a notebook shows, keyframes, replay."""

from __future__ import annotations

import html.parser
import re
import shutil
from pathlib import Path

import mujoco
import numpy as np
import pytest

import dexplan as dx
from dexplan.errors import ProblemError, RunFolderError
from dexplan.notebook import MOST_ROWS, as_html_table
from dexplan.sim import contact_table
from dexplan.sim.judge.replay import replay
from dexplan.sim.trace import Trace

Run = tuple[dx.Problem, dx.Plan, dx.Trace, dx.ValidationReport]
REPLAY = Path(__file__).resolve().parents[1] / "docs" / "replay.md"


@pytest.fixture(scope="module")
def run() -> Run:
    """Three fingers that hold, and lift the ball a little."""
    problem = dx.build_problem(
        {
            "format": 1,
            "name": "up",
            "goal": {"translation_m": [0.0, 0.0, 0.005]},
            "gait": {"improvement": 0.0},
        }
    )
    plan = dx.plan(problem)
    trace = dx.rollout(problem, plan)
    return problem, plan, trace, dx.validate(problem, plan, trace)


@pytest.fixture(scope="module")
def folder(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run, saved."""
    return dx.save_run(tmp_path_factory.mktemp("run") / "up", *run)


# -- problems and runs ---------------------------------------------------------------------------------------------


def test_a_dict_is_checked_as_a_file_is() -> None:
    with pytest.raises(
        ProblemError, match=r"problem: friction.slidign: unknown key 'slidign'; did you mean 'sliding'\?"
    ):
        dx.build_problem({"format": 1, "goal": {"translation_m": [0, 0, 0]}, "friction": {"slidign": 1}})
    for wrong in (
        {},
        {"format": 1},
        {"format": 1, "goal": 3},
        {"format": 1, "goal": {"kind": "object_manipulation"}},
    ):
        with pytest.raises(ProblemError):
            dx.build_problem(wrong)


def test_a_run_is_loaded_as_a_value_with_names(run: Run, folder: Path) -> None:
    saved = dx.load_run(folder)
    assert (saved.problem, saved.trace) == (run[0], run[2])
    assert saved.plan.as_dict() == run[1].as_dict()
    assert dx.validate(*saved).checks == run[3].checks


def test_a_run_without_a_report_leaves_no_older_one(run: Run, folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path / "run")
    dx.save_run(tmp_path / "run", *run[:3])
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == [
        "model.xml",
        "plan.json",
        "problem.toml",
        "trace.npz",
    ]


@pytest.mark.parametrize("name", ["trace.npz", "problem.toml", "report.json", "summary.png"])
def test_saving_leaves_what_no_run_made(run: Run, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine")
    with pytest.raises(RunFolderError, match="was made by no run"):
        dx.save_run(tmp_path, *run)
    assert [p.read_text() for p in tmp_path.iterdir()] == ["mine"]


def test_inspecting_without_a_folder_writes_nothing(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert "finger_1" in dx.inspect(run[0])
    assert not list(tmp_path.iterdir())
    (tmp_path / "inspect.png").write_text("mine")
    with pytest.raises(RunFolderError, match="was made by no run"):
        dx.inspect(run[0], tmp_path)


# -- tables and notebooks ------------------------------------------------------------------------------------------


def test_contacts_are_a_table(run: Run) -> None:
    trace = run[2]
    table = trace.contacts()
    count = int(trace["contact_active"].sum())
    assert {len(column) for column in table.values()} == {count}
    assert list(table) == [*contact_table.KEYS, *(c.name for c in contact_table.COLUMNS)]
    k = count // 2
    t, f = int(table["sample"][k]), int(str(table["finger"][k]).removeprefix("finger_")) - 1
    assert table["time_s"][k] == trace["time"][t]
    assert table["action"][k] == trace["action_index"][t] + 1
    assert [table[f"{x}_O_m"][k] for x in "xyz"] == trace["contact_point_O"][t, f].tolist()
    normal = np.array([table[f"n_{x}_O"][k] for x in "xyz"])
    assert (normal == trace["contact_rotation_O"][t, f][:, 2]).all()
    # n points into the object: against the way from its centre to the contact.
    assert normal @ trace["contact_point_O"][t, f] < 0.0
    names = ("f_t1_N", "f_t2_N", "f_n_N", "tau_n_N_m")
    assert [table[name][k] for name in names] == trace["contact_force"][t, f].tolist()
    planned = [
        table[name][k] for name in ("f_t1_planned_N", "f_t2_planned_N", "f_n_planned_N", "tau_n_planned_N_m")
    ]
    assert planned == trace["contact_force_reference"][t, f].tolist()
    slip = [table[name][k] for name in ("slip_t1_m_s", "slip_t2_m_s", "spin_rad_s")]
    assert slip == trace["contact_slip_velocity"][t, f].tolist()
    assert table["tip_angle_deg"][k] == pytest.approx(np.degrees(trace["tip_contact_angle"][t, f]))


def test_what_a_trace_lacks_is_left_out_of_the_table(run: Run) -> None:
    trace = run[2]
    short = Trace(
        trace.model_xml, {name: trace[name] for name in ("time", "contact_active", "contact_force")}, {}
    )
    assert list(short.contacts()) == ["time_s", "sample", "finger", "f_t1_N", "f_t2_N", "f_n_N", "tau_n_N_m"]
    with pytest.raises(KeyError, match="contact_active"):
        Trace(trace.model_xml, {}, {}).contacts()
    nobody = Trace(trace.model_xml, {"contact_active": np.zeros((5, 3), dtype=bool)}, {})
    assert [len(column) for column in nobody.contacts().values()] == [0, 0]


def test_every_column_is_described_where_the_docs_say() -> None:
    page = REPLAY.read_text(encoding="utf-8")
    written = page.split("sim.contact_table -->\n")[1].split("<!-- end")[0]
    assert written == contact_table.describe_columns()
    for column in contact_table.COLUMNS:
        assert column.unit
        assert column.frame in {"object", "contact", "fingertip"}


class Reader(html.parser.HTMLParser):
    """Counts what stands open."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.open.append(tag)
        self.seen.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.mark.parametrize("which", range(4))
def test_a_notebook_shows_every_value(run: Run, which: int) -> None:
    text = run[which]._repr_html_()
    reader = Reader()
    reader.feed(text)
    assert not reader.open
    assert reader.seen <= {"table", "caption", "b", "tr", "th", "td", "div"}
    told = ("shift the object by (0, 0, 5) mm", "status: solved", "contact_active", "PASS up")[which]
    assert told in text


def test_a_notebook_shows_no_markup_of_others() -> None:
    text = as_html_table(("<b>",), [("<script>alert('x')</script>",)] * (MOST_ROWS + 7), [0], "<i>")
    assert "<script>" not in text
    assert "&lt;script&gt;" in text
    assert "and 7 more" in text
    problem = dx.load_problem("hold_two", {"summary": "<script>"})
    assert "<script>" not in problem._repr_html_()


# -- the model of a run --------------------------------------------------------------------------------------------


def test_the_model_names_start_and_goal(run: Run, folder: Path) -> None:
    _, plan, trace, _ = run
    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    assert (data.qpos == trace["qpos"][0]).all()
    assert (data.ctrl == trace["ctrl"][0]).all()
    assert not data.qvel.any()
    mujoco.mj_resetDataKeyframe(model, data, model.key("goal").id)
    mujoco.mj_forward(model, data)
    ball = data.body("object/").xpos
    assert ball == pytest.approx(plan.X_WO_goal[:3, 3], abs=1e-9)
    # Planned without depth: where a finger touches in the end, it touches; and nothing else does.
    names = {model.geom(g).name for contact in data.contact for g in contact.geom}
    holding = {f"{plan.fingers[c.finger]}/tip" for c in plan.actions[-1].contacts_end if c is not None}
    assert names <= holding | {"object/surface"}
    for tip in holding:
        gap = (
            np.linalg.norm(data.geom(tip).xpos - ball)
            - model.geom(tip).size[0]
            - model.geom("object/surface").size[0]
        )
        assert gap == pytest.approx(0.0, abs=1e-6)
    # The run ends there.
    assert data.qpos == pytest.approx(trace["qpos"][-1], abs=2e-2)


def test_keyframes_change_neither_physics_nor_verdict(run: Run) -> None:
    problem, plan, trace, report = run
    bare = re.sub(r"(?s)  <keyframe>.*</keyframe>\n", "", trace.model_xml)
    assert bare != trace.model_xml
    assert bare == dx.load_scene("three_finger_sphere").xml
    recipe = trace["initial_state"], trace["ctrl"], int(trace["physics_steps_per_sample"])
    assert (replay(bare, *recipe).qpos == replay(trace.model_xml, *recipe).qpos).all()
    assert report.is_passed, report.table()
    assert dx.validate(problem, plan, Trace(bare, trace.columns, trace.meta)).checks == report.checks


def test_the_lines_of_the_docs_replay_a_run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    blocks = re.findall(r"(?s)```python\n(.*?)```", REPLAY.read_text(encoding="utf-8"))
    assert len(blocks) == 2
    for block in blocks:
        exec(compile(block, str(REPLAY), "exec"), {})
    assert (
        len(
            [
                line
                for line in blocks[0].splitlines()
                if line and "assert" not in line and "import" not in line
            ]
        )
        == 6
    )
