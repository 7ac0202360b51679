"""Questions answered by processes that stay."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import lru_cache

import pytest

from dexplan.pool import THREADS, answer_as_done, answer_in_order


@lru_cache
def make_table() -> list[int]:
    """Something that is made once in each process."""
    return []


def answer(question: int) -> tuple[int, int, int, str | None]:
    make_table().append(question)
    return question * question, os.getpid(), len(make_table()), os.environ.get(THREADS[0])


def refuse(question: int) -> int:
    raise ValueError(f"no answer to {question}")


@pytest.mark.parametrize("workers", [1, 2])
def test_answers_come_in_the_order_of_the_questions(workers: int) -> None:
    squares = [found[0] for found in answer_in_order(answer, range(9), workers)]
    assert squares == [k * k for k in range(9)]


def test_processes_stay_keep_what_they_made_and_use_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in THREADS:
        monkeypatch.delenv(name, raising=False)
    found = dict(answer_as_done(answer, range(12), 2))
    assert sorted(found) == list(range(12))
    made = [(process, count) for _, process, count, _ in found.values()]
    assert len({process for process, _ in made}) <= 2
    assert os.getpid() not in {process for process, _ in made}
    # Every answer found what the ones before had left.
    assert len(set(made)) == 12
    assert {threads for *_, threads in found.values()} == {"1"}
    assert THREADS[0] not in os.environ


@pytest.mark.parametrize("workers", [1, 2])
def test_whoever_has_enough_stops_asking(workers: int) -> None:
    taken = []

    def ask() -> Iterator[int]:
        for question in range(100_000):
            taken.append(question)
            yield question

    for square, *_ in answer_in_order(answer, ask(), workers):
        if square == 4:
            break
    assert len(taken) < 100_000


@pytest.mark.parametrize("workers", [1, 2])
def test_what_goes_wrong_is_raised(workers: int) -> None:
    with pytest.raises(ValueError, match="no answer to 3"):
        list(answer_in_order(refuse, [3], workers))
