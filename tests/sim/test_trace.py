"""A trace survives its file bit for bit, and a bad file is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from held_ball import STEPS, record

from dexplan.errors import RunFolderError
from dexplan.sim import trace as trace_module
from dexplan.sim.judge.replay import replay
from dexplan.sim.judge.world import read_world
from dexplan.sim.trace import Trace, check_columns, check_replayable


@pytest.fixture
def trace() -> Trace:
    columns = {
        "time": np.arange(3) * 0.004,
        "qpos": np.array([[1.0, np.nan], [np.pi, -0.0], [1e-320, np.inf]]),
        "contact_active": np.array([[True], [False], [True]]),
        "action_index": np.arange(3),
        "physics_steps_per_sample": np.array(2),
    }
    return Trace("<mujoco><!-- μ --></mujoco>", columns, {"seed": 1, "name": "α", "list": [1, 2.5, None]})


def test_round_trip_is_exact(trace: Trace, tmp_path: Path) -> None:
    again = Trace.load(trace.save(tmp_path / "trace.npz"))
    assert again == trace
    assert again["physics_steps_per_sample"].shape == ()
    assert again.sample_count == 3


def test_same_trace_gives_same_bytes(trace: Trace, tmp_path: Path) -> None:
    first = trace.save(tmp_path / "a.npz").read_bytes()
    second = Trace.load(tmp_path / "a.npz").save(tmp_path / "b.npz").read_bytes()
    assert first == second
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.npz", "b.npz"]


def test_traces_differ_by_any_bit(trace: Trace) -> None:
    other = Trace(trace.model_xml, {**trace.columns, "time": np.nextafter(trace["time"], 1.0)}, trace.meta)
    assert other != trace
    assert Trace(trace.model_xml, trace.columns, {}) != trace


def test_trace_is_read_only(trace: Trace) -> None:
    with pytest.raises(ValueError, match="read-only"):
        trace["time"][0] = 1.0
    with pytest.raises(TypeError):
        trace.columns["time"] = np.zeros(3)  # type: ignore[index]
    with pytest.raises(TypeError, match="Python objects"):
        Trace("", {"time": np.array([None])}, {})


def test_bad_files_are_named(trace: Trace, tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="no such file"):
        Trace.load(tmp_path / "none.npz")
    whole = trace.save(tmp_path / "trace.npz").read_bytes()
    (tmp_path / "half.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(RunFolderError, match="cannot be read"):
        Trace.load(tmp_path / "half.npz")
    np.savez(tmp_path / "other.npz", time=np.zeros(3))
    with pytest.raises(RunFolderError, match="lacks model_xml, meta_json"):
        Trace.load(tmp_path / "other.npz")
    np.savez(tmp_path / "pickled.npz", time=np.array([{}], dtype=object))
    with pytest.raises(RunFolderError, match="cannot be read"):
        Trace.load(tmp_path / "pickled.npz")


def test_replay_gives_the_record_bit_for_bit() -> None:
    run = record(samples=50)
    again = replay(run.model_xml, run["initial_state"], run["ctrl"], STEPS)
    assert np.array_equal(again.qpos, run["qpos"])
    assert np.array_equal(again.qvel, run["qvel"])


def test_replayed_forces_carry_the_ball() -> None:
    run = record(samples=5)
    r = replay(run.model_xml, run["initial_state"], run["ctrl"], STEPS)
    force_O = np.einsum("fij,fj->fi", r.contact_rotation_O[0], r.contact_force[0, :, :3])
    assert r.contact_active.all()
    assert force_O.sum(axis=0) == pytest.approx([0, 0, 0.06 * 9.81], abs=1e-3)
    # n points into the object: opposite to the contact point seen from the centre.
    assert np.all(np.einsum("fi,fi->f", r.contact_rotation_O[0, :, :, 2], r.contact_point_O[0]) < 0)
    assert np.linalg.det(r.contact_rotation_O[0]) == pytest.approx(1.0)


def test_clearance_is_the_distance_of_spheres() -> None:
    run = record(samples=1)
    model = read_world(run.model_xml).model
    state = np.array(run["initial_state"])
    raised = int(model.joint("object/free/").qposadr[0]) + 2
    # The integration state begins with time, then qpos.
    state[1 + raised] += 0.03
    r = replay(run.model_xml, state, run["ctrl"], STEPS)
    expected = np.linalg.norm(r.tip_position[0, 0] - r.object_pose[0, :3]) - 0.053
    assert 0 < expected < r.clearance_horizon
    assert r.clearance[0, 0, 0] == pytest.approx(expected, abs=1e-9)


def test_replay_names_what_does_not_fit() -> None:
    run = record(samples=2)
    with pytest.raises(RunFolderError, match="ctrl has shape"):
        replay(run.model_xml, run["initial_state"], run["ctrl"][:, :-1], STEPS)
    with pytest.raises(RunFolderError, match="initial_state has shape"):
        replay(run.model_xml, run["initial_state"][:-1], run["ctrl"], STEPS)
    with pytest.raises(RunFolderError, match="cannot compile"):
        replay("<mujoco><nonsense/></mujoco>", run["initial_state"], run["ctrl"], STEPS)
    with pytest.raises(RunFolderError, match="lacks fingertips"):
        replay("<mujoco/>", run["initial_state"], run["ctrl"], STEPS)


def _whole() -> dict[str, np.ndarray]:
    T, F = 5, 3
    return {
        "time": np.arange(T) * 0.004,
        "qpos": np.zeros((T, 7)),
        "qvel": np.zeros((T, 6)),
        "ctrl": np.zeros((T, 18)),
        "initial_state": np.zeros(20),
        "physics_steps_per_sample": np.array(4),
        "object_pose_reference": np.tile([0.0, 0.0, 0.16, 1.0, 0.0, 0.0, 0.0], (T, 1)),
        "action_index": np.zeros(T, dtype=int),
        "contact_active": np.zeros((T, F), dtype=bool),
        "contact_rotation_O": np.zeros((T, F, 3, 3)),
        "contact_force": np.zeros((T, F, 4)),
        "tip_contact_angle": np.zeros((T, F)),
    }


def _spoil(values: np.ndarray, place: object, value: float) -> np.ndarray:
    spoilt = values.copy()
    spoilt[place] = value  # type: ignore[index]
    return spoilt


FOREIGN = {
    "many steps": (
        {"physics_steps_per_sample": np.array(10**12)},
        "physics_steps_per_sample is 1000000000000",
    ),
    "no steps": ({"physics_steps_per_sample": np.array(0)}, "a whole number from 1 to"),
    "steps backward": ({"physics_steps_per_sample": np.array(-4)}, "physics_steps_per_sample is -4"),
    "part of a step": ({"physics_steps_per_sample": np.array(4.0)}, "is of type float64"),
    "steps per sample": ({"physics_steps_per_sample": np.full(5, 4)}, "has shape (5,)"),
    "text": ({"ctrl": np.full((5, 18), "0")}, "ctrl is of type <U1"),
    "complex": ({"qpos": np.zeros((5, 7), dtype=complex)}, "qpos is of type complex128"),
    "one axis": ({"ctrl": np.zeros(5)}, "ctrl has shape (5,)"),
    "shorter": ({"ctrl": np.zeros((4, 18))}, "5 as in time is needed, not 4"),
    "other fingers": ({"contact_force": np.zeros((5, 2, 4))}, "3 as in contact_active is needed, not 2"),
    "other width": ({"contact_force": np.zeros((5, 3, 3))}, "4 as in the format is needed, not 3"),
    "no truth": ({"contact_active": np.zeros((5, 3))}, "contact_active is of type float64; booleans"),
    "nan": (
        {"ctrl": _spoil(np.zeros((5, 18)), (2, 3), np.nan)},
        "ctrl holds values that cannot be simulated",
    ),
    "infinite": ({"initial_state": _spoil(np.zeros(20), 3, np.inf)}, "initial_state holds values"),
    "huge": ({"initial_state": _spoil(np.zeros(20), 3, 1e200)}, "initial_state holds values"),
    "back in time": ({"time": np.arange(5)[::-1] * 1.0}, "time does not always grow"),
    "standing time": ({"time": np.zeros(5)}, "time does not always grow"),
    "no attitude": (
        {"object_pose_reference": np.zeros((5, 7))},
        "object_pose_reference holds what is no pose",
    ),
    "far away": ({"object_pose_reference": np.full((5, 7), 1e200)}, "metres and unit quaternions are needed"),
    "disturbance": ({"xfrc_applied": np.zeros((5, 6))}, "xfrc_applied has shape (5, 6)"),
}


@pytest.mark.parametrize(("changes", "message"), FOREIGN.values(), ids=list(FOREIGN))
def test_a_foreign_trace_is_told_in_one_sentence(
    changes: dict[str, np.ndarray], message: str, tmp_path: Path
) -> None:
    path = Trace("<mujoco/>", {**_whole(), **changes}, {}).save(tmp_path / "trace.npz")
    with pytest.raises(RunFolderError) as caught:
        Trace.load(path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")
    assert len(str(caught.value)) < 400


def test_a_trace_that_diverged_is_read() -> None:
    """Its last sample is no number, and the control that would have followed neither."""
    columns = _whole()
    columns["qpos"] = _spoil(columns["qpos"], -1, np.nan)
    columns["ctrl"] = _spoil(columns["ctrl"], -1, np.nan)
    check_replayable(Trace("<mujoco/>", columns, {}))


@pytest.mark.parametrize("name", ["ctrl", "initial_state", "physics_steps_per_sample"])
def test_what_is_replayed_may_not_be_missing(name: str) -> None:
    columns = _whole()
    del columns[name]
    check_columns(Trace("<mujoco/>", columns, {}))
    with pytest.raises(RunFolderError, match=f"lacks {name}"):
        check_replayable(Trace("<mujoco/>", columns, {}))


def test_a_trace_without_samples_cannot_be_judged() -> None:
    columns = {k: v[:0] if v.ndim and len(v) == 5 else v for k, v in _whole().items()}
    with pytest.raises(RunFolderError, match="no samples"):
        check_replayable(Trace("<mujoco/>", columns, {}))


def test_a_file_that_unpacks_to_too_much_is_not_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = Trace("<mujoco/>", _whole(), {}).save(tmp_path / "trace.npz")
    monkeypatch.setattr(trace_module, "LARGEST", 1000)
    with pytest.raises(RunFolderError, match="it unpacks to"):
        Trace.load(path)
