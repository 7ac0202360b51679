"""Workspaces: what is sampled is true, what is stored comes back, and nothing stale is served."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from dexplan.kinematics import workspace as rooms
from dexplan.kinematics.chain import compute_joint_margin, compute_tip_pose
from dexplan.kinematics.finger import FingerDescription
from dexplan.kinematics.workspace import (
    REACH,
    Workspace,
    compute_aligned_pose,
    load_workspace,
    spread_directions,
)
from dexplan.scene.library import load_scene
from dexplan.scene.scene import Scene
from dexplan.spatial import Array, build_frame, make_pose, rotate_about


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene()


@pytest.fixture(scope="module")
def center(scene: Scene) -> Array:
    return scene.object.X_WO_home[:3, 3]


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A cache of this module's own: whatever the user has stored is neither read nor touched."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DEXPLAN_CACHE", str(folder))
        yield folder


@pytest.fixture(scope="module")
def first(scene: Scene, center: Array, cache: Path) -> tuple[Workspace, float]:
    """The one workspace that is really computed, and how long that took [s]."""
    start = time.perf_counter()
    return load_workspace(scene.fingers[0], center), time.perf_counter() - start


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Replace the computation by a sham that keeps count, to see when a new one would be made."""
    calls: list[object] = []

    def sham(chain: object, q_home: Array) -> dict[str, Array]:
        calls.append(chain)
        return {
            "postures": q_home[None],
            "positions": np.zeros((1, 3)),
            "poles": np.array([[0.0, 0.0, 1.0]]),
            "joint_margin": np.zeros(1),
            "spin": np.zeros((1, 2)),
            "counts": np.array([0, 1]),
        }

    monkeypatch.setattr(rooms, "_sample", sham)
    return calls


def test_every_sample_is_what_it_says(first: tuple[Workspace, float], center: Array) -> None:
    workspace = first[0]
    assert len(workspace.postures) > 5000
    chain, X = workspace.chain, compute_tip_pose(workspace.chain, workspace.postures)
    assert np.allclose(X[:, :3, 3], workspace.positions, atol=1e-5)
    assert np.allclose(X[:, :3, 2], workspace.poles, atol=1e-5)
    assert (compute_joint_margin(chain, workspace.postures) >= 0.0).all()
    # The margin that is kept leaves the spin joint out; spin is how far that one can turn.
    arms = workspace.postures[:, :-1]
    margin = np.minimum(arms - chain.lower[:-1], chain.upper[:-1] - arms).min(axis=1)
    assert np.allclose(workspace.joint_margin, margin, atol=1e-9)
    ends = workspace.postures[:, -1:] + workspace.spin
    assert np.allclose(ends, [chain.lower[-1], chain.upper[-1]])
    assert (np.linalg.norm(workspace.positions - center, axis=1) <= REACH + 1e-6).all()


def test_no_position_is_dextrous_in_the_papers_sense(first: tuple[Workspace, float]) -> None:
    """The paper assumes that every point of a workspace is reached in any orientation; this finger has no such point."""
    workspace = first[0]
    assert workspace.sampled_positions > 500
    assert workspace.dextrous_positions == 0


def test_poses_near_samples_are_solved(first: tuple[Workspace, float]) -> None:
    workspace, rng = first[0], np.random.default_rng(0)
    rows = rng.choice(np.flatnonzero(workspace.joint_margin > np.radians(15.0)), 300)
    q = workspace.postures[rows] + rng.uniform(-0.1, 0.1, (300, 6))
    q[:, -1] = rng.uniform(-2.5, 2.5, 300)  # any spin
    X_WF = compute_tip_pose(workspace.chain, q)
    found, reached = workspace.solve(X_WF)
    assert reached.mean() > 0.97
    assert np.allclose(compute_tip_pose(workspace.chain, found)[reached], X_WF[reached], atol=1e-6)
    inside = compute_joint_margin(workspace.chain, found[reached]) >= 0.0
    assert inside.mean() > 0.97


def test_contacts_before_the_finger_are_reached(
    first: tuple[Workspace, float], scene: Scene, center: Array
) -> None:
    """The home posture's own contact and its surroundings: +-30 degrees of azimuth, +-20 of elevation."""
    azimuth, elevation = (a.ravel() for a in np.meshgrid(np.radians([-30, 0, 30]), np.radians([-20, 0, 20])))
    normals = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1
    )
    X_WF = compute_aligned_pose(center, normals, 0.035 + scene.fingers[0].tip_radius)
    q, reached = first[0].solve(X_WF)
    assert reached.all()
    assert (compute_joint_margin(first[0].chain, q)[:] > 0.0).all()


def test_a_second_load_is_the_same_and_cheap(
    first: tuple[Workspace, float], scene: Scene, center: Array, cache: Path, computed: list[object]
) -> None:
    workspace, seconds = first
    start = time.perf_counter()
    again = load_workspace(scene.fingers[0], center)
    assert time.perf_counter() - start < 0.2 * seconds
    assert not computed
    for name in ("postures", "positions", "poles", "joint_margin", "spin"):
        assert np.array_equal(getattr(again, name), getattr(workspace, name))
    assert again.dextrous_positions == workspace.dextrous_positions
    assert again.sampled_positions == workspace.sampled_positions
    assert [entry.suffix for entry in (cache / "workspaces").iterdir()] == [".npz"]


@pytest.mark.parametrize("finger", [1, 2])
def test_fingers_around_the_object_share_one_computation(
    first: tuple[Workspace, float],
    scene: Scene,
    center: Array,
    cache: Path,
    computed: list[object],
    finger: int,
) -> None:
    workspace = load_workspace(scene.fingers[finger], center)
    assert not computed
    turn = rotate_about([0.0, 0.0, 1.0], np.radians(120.0 * finger))
    assert np.allclose(workspace.positions - center, (first[0].positions - center) @ turn.T, atol=1e-9)
    X = compute_tip_pose(scene.fingers[finger].chain, workspace.postures)
    assert np.allclose(X[:, :3, 3], workspace.positions, atol=1e-5)
    assert np.allclose(X[:, :3, 2], workspace.poles, atol=1e-5)


def test_a_workspace_moves_with_the_palm(
    first: tuple[Workspace, float], scene: Scene, center: Array, cache: Path, computed: list[object]
) -> None:
    """Palm and centre moved together: no new computation, and every sample is what the moved finger reaches."""
    X_WP = make_pose(rotate_about(np.array([0.6, 0.0, 0.8]), 0.9), [0.1, -0.2, 0.3])
    workspace = load_workspace(scene.fingers[0], (X_WP @ np.append(center, 1.0))[:3], X_WP)
    assert not computed
    assert np.array_equal(workspace.postures, first[0].postures)
    X = X_WP @ compute_tip_pose(scene.fingers[0].chain, workspace.postures)
    assert np.allclose(compute_tip_pose(workspace.chain, workspace.postures), X, atol=1e-9)
    assert np.allclose(X[:, :3, 3], workspace.positions, atol=1e-5)
    assert np.allclose(X[:, :3, 2], workspace.poles, atol=1e-5)
    found, reached = workspace.solve(X[::500])
    assert reached.mean() > 0.97
    assert np.allclose(compute_tip_pose(workspace.chain, found)[reached], X[::500][reached], atol=1e-6)


def _altered(change: str) -> tuple[FingerDescription, Array]:
    scene = load_scene()
    if change == "joint range":
        scene = load_scene(joint_ranges_deg=(("finger_1.joint_1", -60.0, 60.0),))
    center = scene.object.X_WO_home[:3, 3]
    finger = scene.fingers[0]
    if change == "link length":
        offsets = finger.chain.offsets.copy()
        offsets[2, 0, 3] += 0.001
        chain = rooms.Chain(
            offsets, finger.chain.axes, finger.chain.X_JF, finger.chain.lower, finger.chain.upper
        )
        finger = FingerDescription(
            finger.name,
            finger.joint_names,
            finger.tip_radius,
            chain,
            finger.torque_limit,
            finger.servo_gain,
            finger.servo_damping,
            finger.q_home,
        )
    return finger, center + ([0.0, 0.0, 0.01] if change == "object home" else 0.0)


@pytest.mark.parametrize("change", ["joint range", "link length", "object home"])
def test_another_hand_gets_another_workspace(
    first: tuple[Workspace, float],
    computed: list[object],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    cache: Path,
    change: str,
) -> None:
    stored = next((cache / "workspaces").iterdir())
    (tmp_path / "workspaces").mkdir()
    (tmp_path / "workspaces" / stored.name).write_bytes(stored.read_bytes())
    monkeypatch.setenv("DEXPLAN_CACHE", str(tmp_path))
    load_workspace(*_altered(change))
    assert len(computed) == 1
    assert len(list((tmp_path / "workspaces").iterdir())) == 2
    load_workspace(*_altered(change))
    assert len(computed) == 1


@pytest.mark.parametrize(
    "share",
    [
        pytest.param(0.0, id="empty"),
        pytest.param(0.5, id="cut short"),
        pytest.param(None, id="something else"),
    ],
)
def test_a_damaged_store_is_made_anew(
    scene: Scene,
    center: Array,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    computed: list[object],
    share: float | None,
) -> None:
    monkeypatch.setenv("DEXPLAN_CACHE", str(tmp_path))
    load_workspace(scene.fingers[0], center)
    stored = next((tmp_path / "workspaces").iterdir())
    whole = stored.read_bytes()
    stored.write_bytes(b"not a store" if share is None else whole[: int(share * len(whole))])
    computed.clear()
    load_workspace(scene.fingers[0], center)
    assert len(computed) == 1
    # The store is whole again: the next load computes nothing.
    load_workspace(scene.fingers[0], center)
    assert len(computed) == 1


def test_a_cache_that_cannot_be_written_costs_no_answer(
    scene: Scene, center: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, computed: list[object]
) -> None:
    occupied = tmp_path / "file"
    occupied.write_text("not a folder")
    monkeypatch.setenv("DEXPLAN_CACHE", str(occupied))
    assert len(load_workspace(scene.fingers[0], center).postures) == 1


def test_an_empty_workspace_says_so(first: tuple[Workspace, float]) -> None:
    full = first[0]
    empty = Workspace(
        full.chain, full.postures[:0], full.positions[:0], full.poles[:0], full.joint_margin[:0], full.spin[:0], 0, 1
    )  # fmt: skip
    with pytest.raises(ValueError, match="the workspace is empty"):
        empty.solve(np.eye(4)[None])


def test_directions_are_spread_evenly() -> None:
    directions = spread_directions(500)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1.0)
    assert np.allclose(directions.mean(axis=0), 0.0, atol=0.01)
    # Every cap of 30 degrees gets its share of the sphere, within a tenth.
    caps = (directions @ spread_directions(60).T > np.cos(np.radians(30.0))).mean(axis=0)
    assert np.allclose(caps, 0.5 * (1.0 - np.cos(np.radians(30.0))), rtol=0.15)


def test_aligned_poses_look_at_the_object(center: Array) -> None:
    directions = spread_directions(40)
    X_WF = compute_aligned_pose(center, directions, 0.05)
    assert np.allclose(X_WF[:, :3, 3], center + 0.05 * directions)
    assert np.allclose(X_WF[:, :3, 2], -directions)
    assert np.allclose(X_WF[:, :3, :3], np.stack([build_frame(-n) for n in directions]))
    up = compute_aligned_pose(center, np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]), 0.05)
    assert np.allclose(np.linalg.det(up[:, :3, :3]), 1.0)
    assert np.allclose(np.linalg.det(X_WF[:, :3, :3]), 1.0)
    assert compute_aligned_pose(center, directions[:0], 0.05).shape == (0, 4, 4)
