"""Where a rolling fingertip is aimed at: its planned way, shifted by what it was off when it began to roll."""

from __future__ import annotations

from dataclasses import dataclass

from dexplan.brief import brief_repr
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array


@dataclass(frozen=True, eq=False)
class RollOffset:
    """Constant difference between the tip pose aimed at and the planned one.

    ``height`` [m] along the outward normal, which turns as the contact moves (negative: pressed in); ``shift`` (3,) [m] across
    it when it was measured, and ``R`` (3, 3), both in object axes.
    """

    height: float
    shift: Array
    R: Array

    __repr__ = brief_repr

    @classmethod
    def measure(cls, roll: TipRoll, s: float, X_OF: Array) -> RollOffset:
        """Return the offset of the tip pose ``X_OF`` (4, 4) from the planned one at progress ``s``."""
        X_plan, normal = roll.sample(s)
        off = X_OF[:3, 3] - X_plan[:3, 3]
        height = float(off @ normal)
        return cls(height, off - height * normal, X_OF[:3, :3] @ X_plan[:3, :3].T)

    def apply(self, roll: TipRoll, s: float) -> Array:
        """Return the tip pose X_OF (4, 4) to aim at, at progress ``s``."""
        X, normal = roll.sample(s)
        X[:3, 3] += self.height * normal + self.shift
        X[:3, :3] = self.R @ X[:3, :3]
        return X

    def relaxed(self, roll: TipRoll, s: float, X_OF: Array, share: float) -> RollOffset:
        """Return the offset moved by ``share`` towards the measured height of ``X_OF``: squeeze that nobody planned goes.

        Only the height gives way.  Across the normal the tip lags a little behind its aim while it moves; an offset that
        followed would let it fall behind further and further.
        """
        height = self.measure(roll, s, X_OF).height
        return RollOffset(self.height + share * (height - self.height), self.shift, self.R)
