"""Count the processors that this process may use, and limit them, so that parallel jobs can take one each."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar

_most: ContextVar[int | None] = ContextVar("most", default=None)


def available() -> int:
    """Return how many processors this process may use, at least 1; `at_most` limits it."""
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    most = _most.get()
    return there if most is None else min(there, most)


def in_threads(work: Callable[[int, int], object], count: int, threads: int) -> None:
    """Call `work` with the begin and the end of each of `threads` parts of `count` rows, all at once."""
    if threads == 1:
        work(0, count)
        return
    edges = [count * i // threads for i in range(threads + 1)]
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, edges[:-1], edges[1:]))


@contextmanager
def at_most(count: int) -> Iterator[None]:
    """Limit the number of processors for this thread until the block ends."""
    token = _most.set(count)
    try:
        yield
    finally:
        _most.reset(token)


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Let processes that start inside the block do linear algebra with one thread: there is a process a processor.

    This process does so too if it loads its libraries inside the block. Environment variables that the user has set
    keep their values.
    """
    names = [name for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS") if name not in os.environ]
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name in names:
            os.environ.pop(name, None)
