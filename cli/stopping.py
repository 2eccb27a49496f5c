"""Ctrl-C on the command line: one line on standard error and exit code 130 within a second, whatever is running.

Python raises KeyboardInterrupt between two of its own instructions. Compiled code may run for seconds before the next
one, a library may swallow the exception, and worker processes may be waited for. So a thread listens too, which the
signal wakes at once: what has not ended by itself after a moment, it ends.
"""

from __future__ import annotations

import os
import signal
import socket
import sys
import threading
import time
from contextlib import suppress
from types import FrameType
from typing import NoReturn

__all__ = ["add_to_message", "end", "ignore", "listen", "requested", "unlisten"]

GRACE = 0.3  # [s] to leave what is running, and to remove what it has begun to write
CODE = 128 + signal.SIGINT
SHOW_CURSOR = "\x1b[?25h"  # a progress display hides it

_requested = threading.Event()
_once = threading.Lock()
_message = "towline: stopped"


def listen() -> None:
    """Let an interrupt end this process; call it in the main thread, before anything that takes long."""
    signal.signal(signal.SIGINT, _interrupt)
    mine, woken = socket.socketpair()
    woken.setblocking(False)
    signal.set_wakeup_fd(woken.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_guard, args=(mine, woken), name="Ctrl-C", daemon=True).start()


def unlisten() -> None:
    """Leave interrupts to Python again, for a command that Ctrl-C ends as it should."""
    if signal.getsignal(signal.SIGINT) is _interrupt:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGINT, signal.default_int_handler)


def ignore() -> None:
    """Ignore interrupts from here on: all is written, and an interrupt would only cut Python's shutdown short."""
    if signal.getsignal(signal.SIGINT) is _interrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # first, so that nothing can arrive between the two
        signal.set_wakeup_fd(-1)


def add_to_message(text: str) -> None:
    """Set what the line of an interrupt states beside "stopped", such as how to resume."""
    global _message
    _message = f"towline: stopped{text}"


def requested() -> bool:
    """Return whether an interrupt has arrived."""
    return _requested.is_set()


def end() -> NoReturn:
    """End the process with one line and exit code 130; threads that still compute end with it."""
    while not _once.acquire(timeout=GRACE):  # never released: one line, whoever comes first
        pass
    with suppress(OSError, ValueError):
        if sys.stderr.isatty():
            sys.stderr.write(SHOW_CURSOR)
        sys.stderr.write(f"{_message}\n")
        sys.stderr.flush()
    writing = sys.modules.get("towline.writing")  # nothing is being written where it was never loaded
    if writing is not None:
        writing.remove_unfinished()
    os._exit(CODE)


def _interrupt(signum: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, once: another one would only disturb the clean-up."""
    if not _requested.is_set():
        _quiet()
        raise KeyboardInterrupt


def _quiet() -> None:
    """Remember the interrupt, and keep Python from printing that it was swallowed."""
    _requested.set()
    sys.unraisablehook = lambda unraisable: None
    threading.excepthook = lambda failure: None


def _guard(mine: socket.socket, woken: socket.socket) -> None:
    """End the process a moment after an interrupt; `woken` is kept open by being an argument."""
    while signal.SIGINT not in mine.recv(1):
        pass
    time.sleep(GRACE)
    _quiet()
    end()
