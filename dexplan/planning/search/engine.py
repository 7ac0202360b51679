"""Best first: which node is opened next.

What a node promises is judged when its turn comes, not when it is proposed: most never are.  Nodes like those that were opened,
or tried in vain, wait: else a search would spend its nodes on variations of one idea.
"""

from __future__ import annotations

import heapq
from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Generic

import numpy as np

from dexplan.planning.contacts.oracle import Grip
from dexplan.planning.search.nodes import Node
from dexplan.planning.search.problem import Likes, Problem, Refused
from dexplan.plans.refusal import Refusal, RefusalCount


@dataclass(frozen=True)
class Patience:
    """What a node's priority loses for every one like it that was ``opened``, and for every one that ``failed``, before."""

    opened: float
    failed: float


@dataclass(order=True)
class _Entry(Generic[Grip]):
    priority: float
    serial: int
    node: Node[Grip] = field(compare=False)


@dataclass(eq=False)
class Engine(Generic[Grip]):
    """Searches the way to the goal of a ``problem``; can be asked to go on where it stopped.  ``opened`` counts nodes."""

    problem: Problem[Grip]
    patience: Patience
    opened: int = field(default=0, init=False)
    _heap: list[_Entry[Grip]] = field(default_factory=list, init=False)
    _serial: int = field(default=0, init=False)
    _seen: set[Hashable] = field(default_factory=set, init=False)
    _opened_likes: dict[Hashable, int] = field(default_factory=dict, init=False)
    _failed_likes: dict[Hashable, int] = field(default_factory=dict, init=False)
    _refusals: dict[float, RefusalCount] = field(default_factory=dict, init=False)

    @property
    def is_exhausted(self) -> bool:
        """Whether there is nothing left to open."""
        return not self._heap

    @property
    def promise(self) -> float:
        """The estimated cost of the best way to the goal that is left, as nodes are ranked; inf where none is."""
        return self._heap[0].priority if self._heap else np.inf

    def list_refusals(self, most: int = 2) -> list[Refusal]:
        """Return the most common reasons not to go on among those nearest to the goal, numbers left out."""
        return self._refusals[min(self._refusals)].list_common(most) if self._refusals else []

    def push(self, node: Node[Grip], crowd: float = 0.0) -> None:
        """Propose a node."""
        node = self.problem.estimate(node)
        rank = self.problem.rank(node)
        if np.isfinite(rank):
            heapq.heappush(self._heap, _Entry(rank + crowd, self._serial, node))
            self._serial += 1

    def refuse(self, refused: Refused) -> None:
        """Count a reason not to go on."""
        self._refusals.setdefault(refused.missing, RefusalCount()).add(refused.refusal)

    def run(self, nodes: int) -> Node[Grip] | None:
        """Open up to ``nodes`` more nodes; return one from which the goal is reached, None where there was none."""
        limit = self.opened + nodes
        while self._heap and self.opened < limit:
            entry = heapq.heappop(self._heap)
            problem = self.problem
            key = problem.key_of(entry.node)
            if key in self._seen:
                continue
            node = problem.estimate(entry.node)
            if problem.costs_too_much(node):
                continue
            likes = problem.list_likes(node)
            crowd = self._measure_crowd(likes)
            if problem.rank(node) + crowd > entry.priority:
                self.push(node, crowd)
                continue
            judged = problem.judge(node)
            if judged.again is not None:
                self.push(judged.again)
            if judged.refused is not None:
                self.refuse(judged.refused)
                self._count_failure(likes)
                problem.learn(node)
            if judged.node is None:
                continue
            self._seen.add(key)
            self._opened_likes[likes.opened] = self._opened_likes.get(likes.opened, 0) + 1
            self.opened += 1
            found = problem.expand(judged.node)
            if found.goal is not None:
                return found.goal
            for refused in found.refused:
                self.refuse(refused)
            if found.is_failure:
                self._count_failure(likes)
            for child in found.children:
                self.push(child)
        return None

    def _measure_crowd(self, likes: Likes) -> float:
        opened, failed = self._opened_likes.get(likes.opened, 0), self._failed_likes.get(likes.failing, 0)
        return self.patience.opened * opened + self.patience.failed * failed

    def _count_failure(self, likes: Likes) -> None:
        if likes.failing is not None:
            self._failed_likes[likes.failing] = self._failed_likes.get(likes.failing, 0) + 1
