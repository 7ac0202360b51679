"""The answer no, before it is made into a plan."""

from __future__ import annotations

from dataclasses import dataclass

from dexplan.plans.refusal import Refusal
from dexplan.plans.status import Status


@dataclass(frozen=True)
class No:
    """The ``status`` that refuses a task, what stands in the way as a value, and the whole ``reason`` in words, cure included."""

    status: Status
    reason: str
    refusal: Refusal | None = None
