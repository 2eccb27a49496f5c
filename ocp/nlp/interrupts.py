"""Raise an interrupt (Ctrl-C) again that was swallowed: `heeding` around the work, `raise_if_swallowed` within it.

CasADi calls Python while it converts the operands of an expression, and takes any exception there, an interrupt too, as
"not of this type". Building a robot's expressions takes up to a second, and planning would go on as if nothing had
happened.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

_arrived = threading.Event()


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
