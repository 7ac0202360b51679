"""What users set of a search: what it may use, how long it may take, and what counts as a better plan."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from dexplan.planning.search.cost import Improvement

Primitive = Literal["substitution", "rewind"]


@dataclass(frozen=True)
class SearchOptions:
    """How a plan may be looked for.

    ``node_budget``: nodes that may be opened in all.  ``primitives``: the gaits that may be used; "rewind" alone moves the object
    with one pair of fingers only.  ``improvement``: how long better plans are looked for once there is one, within the budget.
    """

    node_budget: int
    primitives: tuple[Primitive, ...] = ("substitution",)
    improvement: Improvement = field(default_factory=Improvement)
