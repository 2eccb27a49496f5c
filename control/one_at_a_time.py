"""`OneAtATime`: a block that one thread runs at a time."""

from __future__ import annotations

import threading

from ..base.errors import InputError


class OneAtATime:
    """Let only one thread at a time run a block of a controller; a copy is unlocked.

    The steps of a controller follow each other in time. Steps of two threads would mix two robots in one memory.
    """

    def __init__(self):
        lock = threading.RLock()  # a step of a predictive controller is made of others
        self._enter, self._leave = lock.acquire, lock.release

    def __enter__(self) -> None:
        """Enter, or raise InputError if another thread is inside."""
        if not self._enter(False):
            raise InputError("controller must be used by one thread at a time, got two; each robot needs its own")

    def __exit__(self, *_: object) -> None:
        """Leave to others."""
        self._leave()

    def __reduce__(self) -> tuple[type[OneAtATime], tuple[()]]:
        """Copy and pickle without the lock, which belongs to this process and its threads."""
        return OneAtATime, ()
