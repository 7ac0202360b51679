"""Cross products of stacks, without the overhead of numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan.spatial import cross_all


@pytest.mark.parametrize(
    ("one", "other"), [((3,), (3,)), ((5, 3), (3,)), ((4, 6, 3), (4, 1, 3)), ((0, 3), (3,))]
)
def test_they_are_numpys_to_the_bit(one: tuple[int, ...], other: tuple[int, ...]) -> None:
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=one), rng.normal(size=other)
    assert np.array_equal(cross_all(a, b), np.cross(a, b))
