"""Count the processors that this process may use, and limit them, so that parallel jobs can take one each."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_most: ContextVar[int | None] = ContextVar("most", default=None)


def available() -> int:
    """Return how many processors this process may use, at least 1; `at_most` limits it."""
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    most = _most.get()
    return there if most is None else min(there, most)


@contextmanager
def at_most(count: int) -> Iterator[None]:
    """Limit the number of processors for this thread until the block ends."""
    token = _most.set(count)
    try:
        yield
    finally:
        _most.reset(token)
