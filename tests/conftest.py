"""Reduce the time that the garbage collector (a tenth of the whole run) and the start of workers take.

Objects that exist before the first test remain, so they are not searched; all others are searched less often.
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
    """Let one worker collect the tests before the others, which then import modules that are already compiled."""
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


@pytest.fixture(scope="module")
def stable_at_home():
    """Leave out the simulation at home in which `Predictive` looks for growing errors, a second for each new setting.

    The tests in test_control_stability.py do not leave it out.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("towline.control.predictive.grows", lambda *_: False)
        yield
