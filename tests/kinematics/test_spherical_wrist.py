"""The closed form of a pointing finger against forward kinematics, singular values, and Newton's steps."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dexplan.kinematics.chain import Chain, compute_dexterity, compute_tip_jacobian, compute_tip_pose
from dexplan.kinematics.pointing import LENGTH, move_to_base
from dexplan.kinematics.spherical_wrist import compute_least_singular_values, find_spherical_wrist
from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regions import contactable
from dexplan.planning.regions.regions import compute_regions
from dexplan.spatial import Array, make_pose, rotate_about


def build_chain(rng: np.random.Generator) -> Chain:
    """Return a chain with a spherical wrist: any lengths, an offset shoulder, a skew pole, and frames turned at will."""
    sign = rng.choice([-1.0, 1.0])
    axes = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, sign, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    pole = np.array([np.cos(0.3), 0.0, np.sin(0.3)])
    # Places of the hinges and of the tip; the hinges of the shoulder and elbow may lie anywhere along their axes.
    shoulder, elbow = np.array([0.02, 0.013, 0.1]), np.array([0.06, -0.007, 0.08 + 0.05 * rng.random()])
    elbow += shoulder * [1.0, 0.0, 1.0]
    center = np.array([elbow[0] + 0.05 + 0.05 * rng.random(), 0.0, elbow[2] - 0.02])
    places = [np.zeros(3), shoulder, elbow, center - [0.03, 0.0, 0.0], center, center + 0.01 * pole]
    # What each joint's own frame is turned by makes no difference.
    turns = [rotate_about(v / np.linalg.norm(v), 2.0) for v in rng.normal(size=(7, 3))]
    frames = [make_pose(R, p) for R, p in zip(turns, places, strict=False)]
    X_WB = make_pose(turns[6], [0.1, 0.2, 0.3])
    x = np.array([0.0, 1.0, 0.0])
    tip = make_pose(np.stack([x, np.cross(pole, x), pole], axis=1), center + 0.04 * pole)
    offsets = [X_WB @ frames[0]] + [np.linalg.solve(a, b) for a, b in pairwise(frames)]
    local = np.stack([R.T @ a for R, a in zip(turns, [*axes, pole], strict=False)])
    X_JF = np.asarray(np.linalg.solve(frames[-1], tip), dtype=np.float64)
    return Chain(np.stack(offsets), local, X_JF, np.full(6, -3.0), np.full(6, 3.0))


def measure_turns(a: Array, b: Array) -> Array:
    """Return the largest difference (N,) of the angles (N, J), whole turns aside."""
    return np.asarray(np.abs(np.mod(a - b + np.pi, 2.0 * np.pi) - np.pi).max(axis=1))


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_every_posture_is_found_again(seed: int) -> None:
    """Every branch leads to the same tip, one of them by the very angles; and the dexterity is that of the full Jacobian."""
    rng = np.random.default_rng(seed)
    chain = build_chain(rng)
    wrist = find_spherical_wrist(chain)
    assert wrist is not None
    q = rng.uniform(-3.0, 3.0, size=(40, 6))
    X = compute_tip_pose(chain, q)
    goals = move_to_base(chain, X[:, :3, 3], X[:, :3, 2])
    off = np.full(len(q), np.inf)
    branches = wrist.find_branches(q)
    assert len(branches) > 4
    for branch in branches:
        found, exists = wrist.solve(*goals, branch)
        Y = compute_tip_pose(chain, found.T)
        same = np.linalg.norm(Y[:, :3, 2:] - X[:, :3, 2:], axis=1).max(axis=1) < 1e-6
        assert same[exists].all()
        own = measure_turns(found.T[:, :5], q[:, :5])
        off = np.minimum(off, np.where(exists, own, np.inf))
        exact = compute_dexterity(chain, found.T)
        assert np.allclose(wrist.compute_dexterity(found), exact, rtol=0.0, atol=3e-3)
    assert off.max() < 1e-5


def test_least_singular_values_against_lapack(hand: HandModel) -> None:
    """Of sampled postures: to 1e-6 but for the few with two that are nearly equal, for those to half a percent."""
    chain = hand.fingers[0].chain
    J = compute_tip_jacobian(chain, hand.workspaces[0].postures[::9])
    J[:, :3] /= LENGTH
    values = np.linalg.svd(J, compute_uv=False)
    off = np.abs(compute_least_singular_values(np.ascontiguousarray(J.transpose(2, 1, 0))) - values[:, -1])
    alone = values[:, -1] < 0.97 * values[:, -2]
    assert alone.mean() > 0.8
    assert off[alone].max() < 1e-6
    assert off.max() < 5e-3


def test_other_chains_are_left_to_newton(hand: HandModel) -> None:
    chain = hand.fingers[0].chain
    assert find_spherical_wrist(chain) is not None
    for joint, shift in (
        (1, [0.0, 0.01, 0.0]),
        (3, [0.0, 0.01, 0.0]),
        (4, [0.0, 0.01, 0.0]),
        (4, [0.0, 0.0, 0.01]),
    ):
        offsets = chain.offsets.copy()
        offsets[joint, :3, 3] += shift
        assert find_spherical_wrist(replace(chain, offsets=offsets)) is None
    offsets = chain.offsets.copy()
    offsets[3, :3, 3] += [0.0, 0.0, 0.01]  # a bent forearm is still one
    assert find_spherical_wrist(replace(chain, offsets=offsets)) is not None


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (-0.02, 0.015, -0.01)])
def test_regions_are_those_of_newton_steps(
    hand: HandModel, shift: tuple[float, float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The general way, from sampled postures, gives the same regions: at queries, and on the grid up to its border."""
    center = hand.object.X_WO_home[:3, 3] + np.array(shift)
    closed = compute_regions(hand, center)
    normals = spread_directions(1500)
    asked = [region.contains(normals) for region in closed.contactable]
    contactable.compute_contactable.cache_clear()
    with monkeypatch.context() as patch:
        patch.setattr(contactable, "find_spherical_wrist", lambda chain: None)
        stepped = compute_regions(hand, center)
        for one, two, inside in zip(closed.contactable, stepped.contactable, asked, strict=True):
            assert one.level is not two.level
            assert np.array_equal(two.contains(normals), inside)
            assert (one.mask != two.mask).mean() < 5e-4
            assert one.area == pytest.approx(two.area, abs=2e-3)
    contactable.compute_contactable.cache_clear()
