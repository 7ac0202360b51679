"""The engine on a problem without a hand: a walker on a grid, for whom some fields are closed."""

from __future__ import annotations

import ast
import re
from collections import deque
from collections.abc import Hashable
from dataclasses import FrozenInstanceError, dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dexplan.planning.contacts.oracle import Progress
from dexplan.planning.search.engine import Engine, Patience
from dexplan.planning.search.moves import Go
from dexplan.planning.search.nodes import Node, known_bound, trace_back
from dexplan.planning.search.problem import Expansion, Judged, Likes, Refused
from dexplan.plans.refusal import Refusal, RefusalKind

Field = tuple[int, int]
SIZE = 7
CLOSED = Refusal(RefusalKind.NO_PLACE)
AT_ONCE = Patience(0.0, 0.0)


@dataclass(eq=False)
class Walk:
    """From field to field; ``closed`` ones are found to be so only when somebody wants to go there.

    ``gates`` open to who comes a second time, for two steps more.
    """

    closed: set[Field]
    goal: Field = (SIZE - 1, SIZE - 1)
    gates: set[Field] = field(default_factory=set)
    judged: list[Field] = field(default_factory=list)
    opened: list[Field] = field(default_factory=list)
    learnt: list[Field] = field(default_factory=list)

    def key_of(self, node: Node[Field]) -> Hashable:
        return node.grip

    def list_likes(self, node: Node[Field]) -> Likes:
        return Likes(node.grip[0], node.grip[0])

    def estimate(self, node: Node[Field]) -> Node[Field]:
        return replace(node, bound=float(sum(abs(a - b) for a, b in zip(node.grip, self.goal, strict=True))))

    def rank(self, node: Node[Field]) -> float:
        return node.cost + known_bound(node)

    def costs_too_much(self, node: Node[Field]) -> bool:
        return False

    def judge(self, node: Node[Field]) -> Judged[Field]:
        self.judged.append(node.grip)
        if node.grip in self.closed:
            return Judged(refused=Refused(CLOSED, known_bound(node)))
        if node.grip in self.gates and not node.may_detour:
            again = replace(node, cost=node.cost + 2.0, may_detour=True)
            return Judged(refused=Refused(CLOSED, known_bound(node)), again=again)
        return Judged(node)

    def learn(self, node: Node[Field]) -> None:
        self.learnt.append(node.grip)

    def expand(self, node: Node[Field]) -> Expansion[Field]:
        self.opened.append(node.grip)
        if node.grip == self.goal:
            return Expansion(goal=node)
        x, y = node.grip
        around = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        return Expansion(
            tuple(
                Node(Progress(0, 0), there, node.cost + 1.0, parent=node, moves=(Go(1),))
                for there in around
                if min(there) >= 0 and max(there) < SIZE
            )
        )


def search(walk: Walk, patience: Patience = AT_ONCE, first: Field = (0, 0)) -> Engine[Field]:
    engine = Engine(walk, patience)
    engine.push(Node(Progress(0, 0), first))
    return engine


def measure(walk: Walk) -> float:
    """Return the length of the shortest walk, by plain breadth-first search; inf where there is none."""
    known, wave = {(0, 0): 0}, deque([(0, 0)])
    while wave:
        x, y = wave.popleft()
        for there in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            inside = min(there) >= 0 and max(there) < SIZE
            if inside and there not in walk.closed and there not in known:
                known[there] = known[x, y] + 1
                wave.append(there)
    return known.get(walk.goal, np.inf)


fields = st.tuples(st.integers(0, SIZE - 1), st.integers(0, SIZE - 1))


@given(closed=st.sets(fields, max_size=20), step=st.integers(1, 5))
@settings(max_examples=150, deadline=None, derandomize=True, database=None)
def test_the_shortest_way_is_found_however_it_is_asked_for(closed: set[Field], step: int) -> None:
    walk = Walk(closed - {(0, 0)})
    shortest = measure(walk)
    whole = search(walk).run(10_000)
    assert (np.inf if whole is None else whole.cost) == shortest
    # Asked for a few nodes at a time it does the very same.
    again = Walk(walk.closed)
    engine = search(again)
    found = None
    while found is None and not engine.is_exhausted:
        found = engine.run(step)
    assert again.opened == walk.opened
    if whole is not None and found is not None:
        assert [n.grip for n in trace_back(found)] == [n.grip for n in trace_back(whole)]
        assert len(trace_back(found)) == shortest + 1


def test_nodes_are_judged_when_their_turn_comes_and_refusals_are_counted_by_nearness() -> None:
    walk = Walk({(3, y) for y in range(1, SIZE)} | {(SIZE - 1, SIZE - 1)})
    engine = search(walk)
    assert engine.run(10_000) is None
    assert engine.is_exhausted
    assert len(walk.opened) == engine.opened == len(set(walk.opened))
    assert not set(walk.opened) & walk.closed
    # Closed fields may be tried from every side; each refusal is learnt from.
    assert walk.learnt == [f for f in walk.judged if f in walk.closed]
    assert engine.list_refusals() == [CLOSED]
    first = search(Walk(set()))
    assert first.run(3) is None
    assert first.problem.judged == first.problem.opened  # type: ignore[attr-defined]
    assert len(first._heap) > 0


def test_what_is_to_be_tried_again_costs_more_and_is_tried_when_its_turn_comes() -> None:
    gate = {(3, y) for y in range(SIZE)}
    walk = Walk(set(), gates=gate)
    found = search(walk).run(10_000)
    assert found is not None
    assert found.cost == 2.0 * (SIZE - 1) + 2.0
    assert sum(node.may_detour for node in trace_back(found)) == 1


def test_likes_of_what_was_opened_or_failed_wait() -> None:
    """Many ways lead along one column, all much alike: with patience the walker looks elsewhere meanwhile."""
    closed = {(1, y) for y in range(SIZE)}
    walks = [Walk(set(closed), goal=(0, SIZE - 1)) for _ in range(2)]
    for walk, patience in zip(walks, (AT_ONCE, Patience(5.0, 5.0)), strict=True):
        engine = search(walk, patience)
        engine.push(Node(Progress(0, 0), (4, 0), cost=6.0))
        assert engine.run(10_000) is not None
    eager, patient = (walk.opened for walk in walks)
    assert {x for x, _ in eager} == {0}
    assert 4 in {x for x, _ in patient}


def test_nodes_are_frozen() -> None:
    node = Node(Progress(0, 0), (0, 0))
    with pytest.raises(FrozenInstanceError):
        node.cost = 1.0  # type: ignore[misc]
    opened = replace(node, bound=2.0)
    assert node.bound is None
    assert known_bound(opened) == 2.0


def test_tasks_name_no_hand_and_no_object() -> None:
    """No code of the room is for balls, six joints or three fingers; nothing is keyed by a normal.

    Whether an object looks the same from all sides is asked of the object, how a finger is solved of its chain.
    """
    room = Path(__file__).resolve().parents[2] / "dexplan" / "planning" / "tasks"
    special = re.compile(r"ball|(?<!ico)sphere|cube|(three|six)(_|$)", re.I)
    found = []
    for path in sorted(room.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            where = f"{path.name}:{getattr(node, 'lineno', 0)}"
            match node:
                case ast.Name(id=name) | ast.Attribute(attr=name) | ast.FunctionDef(name=name):
                    found += [f"{where} {name}"] if special.search(name) else []
                case ast.Call(func=ast.Attribute(attr="tobytes", value=value)):
                    found += [f"{where} key"] if "normal" in ast.unparse(value) else []
                case ast.Compare(left=left, comparators=[ast.Constant(value=3 | 6)]):
                    counted = ast.unparse(left)
                    found += [f"{where} {counted}"] if "fingers" in counted or "joints" in counted else []
                case _:
                    pass
    assert not found


def test_the_engine_knows_no_hand_and_no_object() -> None:
    """No file of the room speaks of what only some hands and objects are, or keys anything by a normal."""
    room = Path(__file__).resolve().parents[2] / "dexplan" / "planning" / "search"
    special = re.compile(
        r"\b(ball|sphere|spherical|cube|three fingers|six joints|hinges|normals?|wrist|orbits?)\b", re.I
    )
    for path in sorted(room.glob("*.py")):
        text = path.read_text(encoding="utf-8")
        assert not special.search(text), f"{path.name}: {special.search(text)}"
