"""The judge's force audit and Clarabel say the same, on a small part of what ``scripts/audit_sweep`` asks."""

from __future__ import annotations

import numpy as np

from dexplan.witness.force_audit import BAND, compare, compute_margin, move_to_border, sample_random


def test_audit_agrees_with_clarabel() -> None:
    found = compare(sample_random(100, np.random.default_rng(5)))
    assert found.disagreements == ()
    assert len(found.undecided) <= 1
    assert found.unsolved == 0
    assert 25 <= found.feasible <= 75
    assert found.in_band <= 10
    assert BAND < found.nearest < 1e-3


def test_border_lies_where_the_margin_vanishes() -> None:
    rng = np.random.default_rng(1)
    question = next(q for q in sample_random(20, rng) if compute_margin(q) > 0.05)
    for _ in range(5):
        assert abs(compute_margin(move_to_border(question, rng))) < 0.05
