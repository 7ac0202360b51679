"""Tip poses solved in closed form: against the sampled workspace, forward kinematics, Newton's steps and singular values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from dexplan.kinematics import spherical_wrist
from dexplan.kinematics.chain import (
    Chain,
    compute_dexterity,
    compute_joint_margin,
    compute_tip_pose,
    solve_ik,
)
from dexplan.kinematics.spherical_wrist import (
    Branch,
    SphericalWrist,
    estimate_dexterity,
    find_sampled_branches,
    find_spherical_wrist,
    solve_near,
    solve_tip_pose,
)
from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.admissible.aligned import build_aligned
from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array, rotate_about


def find_wrist(chain: Chain) -> SphericalWrist:
    wrist = find_spherical_wrist(chain)
    assert wrist is not None
    return wrist


def build_other(chain: Chain) -> Chain:
    """Return the chain with its fifth hinge beside the others: no spherical wrist any more."""
    offsets = chain.offsets.copy()
    offsets[4, :3, 3] += [0.0, 0.004, 0.0]
    other = replace(chain, offsets=offsets)
    assert find_spherical_wrist(other) is None
    return other


def turn_between(a: Array, b: Array) -> Array:
    """Return the largest difference (N,) of angles (N, J), whole turns aside."""
    return np.asarray(np.abs(np.mod(a - b + np.pi, 2.0 * np.pi) - np.pi).max(axis=1))


def branch_of(wrist: SphericalWrist, q: Array) -> Branch:
    """Return the branch of one posture (J,)."""
    (found,) = wrist.find_branches(q[None])
    return found


def touch_all_over(hand: HandModel, finger: int) -> Array:
    """Return tip poses (N, 4, 4) that touch the ball all over, with spins of all sizes."""
    normals = spread_directions(400)
    X = build_aligned(hand, finger, hand.object.X_WO_home[:3, 3], normals)
    spins = np.linspace(-3.0, 3.0, len(X))
    X[:, :3, :3] = X[:, :3, :3] @ rotate_about(np.array([0.0, 0.0, 1.0]), spins)
    return X


@pytest.mark.parametrize("finger", [0, 1, 2])
def test_solved_postures_have_the_tip_where_it_was_asked_for(hand: HandModel, finger: int) -> None:
    workspace, X = hand.workspaces[finger], touch_all_over(hand, finger)
    q, reached = solve_tip_pose(workspace, X)
    assert 0.2 < reached.mean() < 1.0
    assert np.abs(compute_tip_pose(workspace.chain, q[reached]) - X[reached]).max() < 1e-9
    # Angles are told within half a turn of the middle of their ranges.
    middle = 0.5 * (workspace.chain.lower + workspace.chain.upper)
    assert np.abs(q - middle).max() <= np.pi + 1e-12


@pytest.mark.parametrize("finger", [0, 1, 2])
def test_solved_postures_are_the_workspace_s_but_for_the_branch(hand: HandModel, finger: int) -> None:
    workspace, X = hand.workspaces[finger], touch_all_over(hand, finger)
    wrist, chain = find_wrist(workspace.chain), workspace.chain
    q, reached = solve_tip_pose(workspace, X)
    newton, there = workspace.solve(X)
    # What Newton's steps reach is in reach; that they miss some is what the closed form is for.
    assert reached[there].all()
    usable = there & (compute_joint_margin(chain, newton) > np.radians(1.0))
    assert usable.sum() > 50
    same = usable & (turn_between(q, newton) < 1e-4)
    for k in np.flatnonzero(usable & ~same):
        assert branch_of(wrist, q[k]) != branch_of(wrist, newton[k])
    assert same.sum() > 0.9 * usable.sum()
    # Wherever Newton has room in its joints, the closed form has some too.
    roomy = np.flatnonzero(usable & (room_of(chain, newton) > np.radians(5.0)))
    assert (room_of(chain, q[roomy]) > np.radians(5.0) - 1e-6).all()


def room_of(chain: Chain, q: Array) -> Array:
    """Return how far (N,) the joints but the last are from their limits."""
    return np.asarray(np.minimum(q - chain.lower, chain.upper - q)[:, :-1].min(axis=1))


def test_the_usual_branch_is_taken_where_it_leaves_room_and_else_the_roomiest(hand: HandModel) -> None:
    workspace, X = hand.workspaces[0], touch_all_over(hand, 0)
    chain, wrist = workspace.chain, find_wrist(workspace.chain)
    q, reached = solve_tip_pose(workspace, X)
    usual, *others = find_sampled_branches(workspace)
    assert usual == branch_of(wrist, hand.fingers[0].q_home)
    assert others
    room = []
    for branch in (usual, *others):
        near = choose_on(wrist, workspace.postures, branch)
        on, there = solve_near(chain, X, np.tile(near, (len(X), 1)))
        # Within a turn of the middle, as the joints' limits see them.
        on += 2.0 * np.pi * np.round((0.5 * (chain.lower + chain.upper) - on) / (2.0 * np.pi))
        room.append(np.where(there, room_of(chain, on), -np.inf))
    rooms = np.stack(room)
    assert np.array_equal(reached, np.isfinite(rooms).any(axis=0))
    taken = room_of(chain, q)
    is_roomy = rooms[0] >= spherical_wrist.ROOM
    assert is_roomy.any()
    assert np.allclose(taken[is_roomy], rooms[0][is_roomy], atol=1e-9)
    tight = reached & (rooms.max(axis=0) < spherical_wrist.ROOM)
    assert tight.any()
    assert np.allclose(taken[tight], rooms.max(axis=0)[tight], atol=1e-9)
    between = reached & ~is_roomy & ~tight
    assert (taken[between] >= spherical_wrist.ROOM - 1e-9).all()


def choose_on(wrist: SphericalWrist, postures: Array, branch: Branch) -> Array:
    """Return one of the postures (N, J) that lies on the branch."""
    return next(q for q in postures if branch in wrist.find_branches(q[None]))


@given(seed=st.integers(0, 10_000))
@settings(max_examples=25, deadline=None, derandomize=True, database=None)
def test_solve_near_stays_on_the_branch_it_is_given(hand: HandModel, seed: int) -> None:
    """A tip that moved a little, and spun by more: the posture near by, the last joint as near as whole turns allow."""
    rng = np.random.default_rng(seed)
    chain, wrist = hand.fingers[0].chain, find_wrist(hand.fingers[0].chain)
    near = hand.workspaces[0].postures[rng.integers(len(hand.workspaces[0].postures))].copy()
    near[-1] += 2.0 * np.pi * rng.integers(-1, 2)
    branch = branch_of(wrist, near)
    q_true = near + rng.uniform(-0.05, 0.05, size=(20, 6))
    on_branch = np.array([wrist.find_branches(q[None]) == (branch,) for q in q_true], dtype=bool)
    X = compute_tip_pose(chain, q_true)
    q, reached = solve_near(chain, X, np.tile(near, (20, 1)))
    assert reached[on_branch].all()
    assert np.abs(compute_tip_pose(chain, q[reached]) - X[reached]).max() < 1e-9
    # The very angles: nothing jumped to another branch or by a whole turn.  Near a straight wrist angles are ill-defined.
    firm = on_branch & (compute_dexterity(chain, q_true) > 0.05)
    assert np.abs(q[firm] - q_true[firm]).max(initial=0.0) < 1e-5
    for row in q[firm]:
        assert branch_of(wrist, row) == branch


def test_other_builds_and_mixed_branches_go_the_general_way(
    hand: HandModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace, X = hand.workspaces[0], touch_all_over(hand, 0)
    chain, other = workspace.chain, build_other(workspace.chain)
    calls: list[int] = []

    def watch(
        chain: Chain, X_WF: Array, q_start: Array, *, tolerance: float
    ) -> tuple[Array, NDArray[np.bool_]]:
        calls.append(len(X_WF))
        return solve_ik(chain, X_WF, q_start, tolerance=tolerance)

    monkeypatch.setattr(spherical_wrist, "solve_ik", watch)
    near = workspace.postures[::400][:20]
    moved = compute_tip_pose(other, near + 0.02)
    q, reached = solve_near(other, moved, near)
    assert calls == [len(near)]
    assert reached.mean() > 0.9
    assert np.abs(compute_tip_pose(other, q[reached]) - moved[reached]).max() < 1e-6
    assert np.array_equal(q, solve_ik(other, moved, near)[0])
    # Two branches at once: the closed form would have to guess.
    wrist = find_wrist(chain)
    usual, second = find_sampled_branches(workspace)[:2]
    both = np.stack([choose_on(wrist, workspace.postures, b) for b in (usual, second)])
    solve_near(chain, compute_tip_pose(chain, both + 0.01), both)
    assert calls == [len(near), 2]
    # A workspace of another build answers for itself.
    built = replace(workspace, chain=other)
    q, reached = solve_tip_pose(built, X)
    general, there = built.solve(X)
    assert np.array_equal(q, general)
    assert np.array_equal(reached, there)


def test_dexterity_is_estimated_for_any_chain(hand: HandModel) -> None:
    chain, q = hand.fingers[0].chain, hand.workspaces[0].postures[::40]
    exact = compute_dexterity(chain, q)
    quick = estimate_dexterity(chain, q)
    assert np.abs(quick - exact).max() < 3e-3
    # Never on the wrong side of the limit by more than that, which is what it is asked for.
    limit = hand.limits.dexterity
    wrong = (quick >= limit) != (exact >= limit)
    assert np.abs(exact[wrong] - limit).max(initial=0.0) < 3e-3
    assert ((exact < limit).any(), (exact > limit).any()) == (True, True)
    other = build_other(chain)
    assert np.array_equal(estimate_dexterity(other, q), compute_dexterity(other, q))
    # The estimate does not depend on how the chain's postures lie in memory, or on how many are asked.
    assert np.allclose(estimate_dexterity(chain, np.asfortranarray(q))[:3], estimate_dexterity(chain, q[:3]))
