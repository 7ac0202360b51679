"""What a plan costs: gaits, the object's path, the load on its contacts, and how little it leaves to spare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from dexplan.plans.actions import Action, count_placements

ROOM = 5.0
"""Clearance [mm] from which on more of it is worth nothing."""


@dataclass(frozen=True)
class CostWeights:
    """What counts how much, in placements: one ``placement``, a ``turn`` of the object by one radian (or a shift of ``SHIFT``),
    a cone used to the full by the worst ``load``, and a ``clearance`` of nothing at all instead of 5 mm or more.
    """

    placement: float = 1.0
    turn: float = 0.25
    load: float = 1.0
    clearance: float = 0.5


SHIFT = 0.02
"""A shift this long [m] costs as much as a turn by one radian."""


@dataclass(frozen=True)
class Improvement:
    """How long better plans are looked for once there is one: ``share`` nodes more per node that the first plan took."""

    share: float = 0.0
    weights: CostWeights = field(default_factory=CostWeights)


def compute_cost(
    weights: CostWeights,
    placements: float,
    turned: float,
    shifted: float,
    margins: Sequence[Mapping[str, float]],
) -> float:
    """Return the cost of a plan with this many placements, turns [rad] and shifts [m], and these margins of its steps.

    ``margins`` are as in ``plan.json``: ``load`` is the share of the believed cone left, ``clearance_mm`` in millimetres.
    """
    load = max((1.0 - m["load"] for m in margins if "load" in m), default=0.0)
    clearance = min((m["clearance_mm"] for m in margins if "clearance_mm" in m), default=ROOM)
    return (
        weights.placement * placements
        + weights.turn * (turned + shifted / SHIFT)
        + weights.load * load
        + weights.clearance * max(0.0, 1.0 - clearance / ROOM)
    )


def compute_actions_cost(weights: CostWeights, actions: Sequence[Action]) -> float:
    """Return the cost of a plan's actions, or of some of them."""
    return compute_cost(
        weights,
        count_placements(actions),
        sum(abs(a.motion.angle) for a in actions),
        sum(float(np.linalg.norm(a.motion.shift_W)) for a in actions),
        [a.margins for a in actions],
    )
