"""What poses a problem to the engine: what a node is worth, what it leads to, and why it is refused."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol

from dexplan.planning.contacts.oracle import Grip
from dexplan.planning.search.nodes import Node
from dexplan.plans.refusal import Refusal


@dataclass(frozen=True)
class Refused:
    """Why a node, or a way on from it, is none; ``missing`` is how far from the goal that was, as the node's bound."""

    refusal: Refusal
    missing: float = 0.0


@dataclass(frozen=True)
class Judged(Generic[Grip]):
    """What came of judging a node: the ``node`` with what was found, or why it is ``refused``.

    ``again``: what is to be tried instead, when its turn comes.
    """

    node: Node[Grip] | None = None
    refused: Refused | None = None
    again: Node[Grip] | None = None


@dataclass(frozen=True)
class Expansion(Generic[Grip]):
    """What a node leads to: the ``goal``, or ``children``, and why some ways on are none.

    ``is_failure``: it was all but there, and is of no use after all; its likes are then put back.
    """

    children: tuple[Node[Grip], ...] = ()
    refused: tuple[Refused, ...] = ()
    goal: Node[Grip] | None = None
    is_failure: bool = False


class Likes(NamedTuple):
    """What small variations of a node have in common, and what nodes share that are ``failing`` together; None where nothing."""

    opened: Hashable
    failing: Hashable | None


class Problem(Protocol[Grip]):
    """A problem posed to the engine.  No question changes anything but what :meth:`learn` is told."""

    def key_of(self, node: Node[Grip]) -> Hashable:
        """Return what makes two nodes the same; only the first of them is opened."""
        ...

    def list_likes(self, node: Node[Grip]) -> Likes:
        """Return what a node shares with those that are much like it."""
        ...

    def estimate(self, node: Node[Grip]) -> Node[Grip]:
        """Return the node with its bound as it is now known; inf where no way leads on."""
        ...

    def rank(self, node: Node[Grip]) -> float:
        """Return the priority of a node whose bound is known, the smallest first; what is learnt may only raise it."""
        ...

    def costs_too_much(self, node: Node[Grip]) -> bool:
        """Return whether a way through a node is no improvement on what is known."""
        ...

    def judge(self, node: Node[Grip]) -> Judged[Grip]:
        """Return whether the moves that lead to a node can be made."""
        ...

    def learn(self, node: Node[Grip]) -> None:
        """Take into account that a node was refused."""
        ...

    def expand(self, node: Node[Grip]) -> Expansion[Grip]:
        """Return what a judged node leads to."""
        ...
