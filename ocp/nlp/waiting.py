"""Do long work in a thread of its own, so that Ctrl-C ends the wait for it at once: `wait_for`.

CasADi and the solvers compute for seconds without returning to Python, and an interrupt that arrives in one of their
callbacks becomes a warning and a normal return. Python delivers signals to the main thread alone, so the work is done
in another one, and the caller waits where an interrupt is raised as usual.

CasADi calls Python while it converts the operands of an expression, and takes any exception there, an interrupt too, as
"not of this type". Building a robot's expressions takes up to a second, and planning would go on as if nothing had
happened.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from types import FrameType
from typing import Any, NoReturn, TypeAlias, TypeVar

POLL = 0.1  # [s]: on Windows an interrupt is raised only between two checks
Result = TypeVar("Result")
Errands: TypeAlias = "SimpleQueue[Callable[[], Any] | None]"
_arrived = threading.Event()


def wait_for(work: Callable[[], Result], errands: Errands | None = None) -> Result:
    """Return what `work` returns, computed in a thread of its own.

    - `work`: if the wait ends early, this is left to run: the process does not end before it does.
    - `errands`: what `work` puts here is called in the caller's thread, in order, while it waits.

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


@contextmanager
def heeding() -> Iterator[None]:
    """Remember an interrupt that arrives in the block, and raise it no later than at the end of the block.

    Nothing changes if the program has its own handler, or in threads other than the main one. Raises
    `KeyboardInterrupt` if one was swallowed.
    """
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    _arrived.clear()
    signal.signal(signal.SIGINT, _remember)
    try:
        yield
    except Exception:  # what an interrupt became, such as the failed import of a compiled module
        raise_if_swallowed()
        raise
    except BaseException:  # the interrupt itself, or what ends the program anyway
        _arrived.clear()
        raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    raise_if_swallowed()


def raise_if_swallowed() -> None:
    """Raise the interrupt that arrived, if any; in the main thread, as Python does.

    Raises `KeyboardInterrupt` if one arrived that nobody raised since.
    """
    if _arrived.is_set() and threading.current_thread() is threading.main_thread():
        _arrived.clear()
        raise KeyboardInterrupt


def _remember(signum: int, frame: FrameType | None) -> NoReturn:
    _arrived.set()
    raise KeyboardInterrupt
