"""Less work around the tests: for the garbage collector, which would take a tenth of the time of all, and for workers.

What exists before the first test stays, so it is not searched. The rest is searched after more new objects than usual.
"""

import gc
import os
from pathlib import Path

import pytest

try:
    import fcntl
except ImportError:  # as on Windows: each worker compiles what it imports
    fcntl = None

NEW_OBJECTS = 20_000


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect; of workers in a new installation one before the others, which find compiled what they import."""
    gc.disable()
    if fcntl is None or "PYTEST_XDIST_WORKER" not in os.environ:
        return (yield)
    with Path(__file__).open() as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:  # another is the first: this one waits for its end
            fcntl.flock(lock, fcntl.LOCK_SH)
            fcntl.flock(lock, fcntl.LOCK_UN)
        except OSError:  # a file system without such locks: each worker compiles what it imports
            pass
        return (yield)


def pytest_collection_finish():
    gc.enable()
    gc.set_threshold(NEW_OBJECTS)
    gc.collect()
    gc.freeze()
