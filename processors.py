"""How many processors this process may use, and a way to use fewer: what runs beside others takes one each."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_most: ContextVar[int | None] = ContextVar("most", default=None)


def available() -> int:
    """Processors that this process may use, at least 1; fewer inside of `at_most`."""
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    most = _most.get()
    return there if most is None else min(there, most)


@contextmanager
def at_most(count: int) -> Iterator[None]:
    """Use no more than so many processors while the block runs, in this thread."""
    token = _most.set(count)
    try:
        yield
    finally:
        _most.reset(token)
