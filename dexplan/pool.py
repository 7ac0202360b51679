"""Many questions answered by processes that stay: scenes, workspaces and tables are made once in each of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from multiprocessing import get_context
from typing import TypeVar

Question = TypeVar("Question")
Answer = TypeVar("Answer")

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""What libraries of linear algebra read when they load.  Matrices are small here: one thread per process does most."""
AHEAD = 2
"""Questions handed out per process before an answer is waited for: none waits for work, and little is done in vain."""


def answer_in_order(
    answer: Callable[[Question], Answer], questions: Iterable[Question], workers: int
) -> Iterator[Answer]:
    """Yield the answer to each question in the order of the questions: see :func:`answer_as_done`."""
    early: dict[int, Answer] = {}
    following = 0
    for number, found in answer_as_done(answer, questions, workers):
        early[number] = found
        while following in early:
            yield early.pop(following)
            following += 1


def answer_as_done(
    answer: Callable[[Question], Answer], questions: Iterable[Question], workers: int
) -> Iterator[tuple[int, Answer]]:
    """Yield the number of each question and its answer, as answers come; what a process keeps in memory serves what follows.

    ``answer`` is a function of a module, and questions and answers are values that can be pickled.  Questions are taken as they
    are needed, so that whoever has enough stops asking.  One worker is this process itself.
    """
    numbered = enumerate(questions)
    if workers <= 1:
        for number, question in numbered:
            yield number, answer(question)
        return
    asked: dict[Future[Answer], int] = {}
    with _one_thread_each(), ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        try:
            while True:
                for number, question in islice(numbered, AHEAD * workers - len(asked)):
                    asked[pool.submit(answer, question)] = number
                if not asked:
                    return
                for done in wait(asked, return_when=FIRST_COMPLETED).done:
                    yield asked.pop(done), done.result()
        finally:
            pool.shutdown(cancel_futures=True)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes that are started meanwhile use one thread each for linear algebra, where nobody asked for more."""
    asked = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(asked, "1"))
    try:
        yield
    finally:
        for name in asked:
            os.environ.pop(name, None)
