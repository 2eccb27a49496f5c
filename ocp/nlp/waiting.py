"""Do long work in a thread of its own, so that Ctrl-C ends the wait for it at once: `wait_for`.

CasADi and the solvers compute for seconds without returning to Python, and an interrupt that arrives in one of their
callbacks becomes a warning and a normal return. Python delivers signals to the main thread alone, so the work is done
in another one, and the caller waits where an interrupt is raised as usual.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from queue import Empty, SimpleQueue
from typing import Any, TypeAlias, TypeVar

from .interrupts import raise_if_swallowed

POLL = 0.1  # [s]: on Windows an interrupt is raised only between two checks
Result = TypeVar("Result")
Errands: TypeAlias = "SimpleQueue[Callable[[], Any] | None]"


def wait_for(work: Callable[[], Result], errands: Errands | None = None) -> Result:
    """Return what `work` returns, computed in a thread of its own.

    Parameters
    ----------
    work
        If the wait ends early, this is left to run: the process does not end before it does.
    errands
        What `work` puts here is called in the caller's thread, in order, while it waits.

    Raises `KeyboardInterrupt` if an interrupt arrives meanwhile. Exceptions of `work` or of an errand are raised as
    well.
    """
    raise_if_swallowed()
    queue: Errands = SimpleQueue() if errands is None else errands
    done: Future[Result] = Future()

    def run() -> None:
        try:
            done.set_result(work())
        except BaseException as error:
            done.set_exception(error)
        finally:
            queue.put(None)

    threading.Thread(target=run, name="towline solver").start()
    while True:
        try:
            errand = queue.get(timeout=POLL)
        except Empty:
            continue
        if errand is None:
            return done.result()
        errand()
