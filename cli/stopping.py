"""Ctrl-C and SIGTERM on the command line: one line on standard error, and exit code 130 or 143, within a second.

SIGTERM is how Slurm, systemd and containers end a command. Python raises KeyboardInterrupt between two of its own
instructions. Compiled code may run for seconds before the next one, a library may swallow the exception, and worker
processes may be waited for. So a thread listens too, which the signal wakes at once, and ends what is still running a
moment later.
"""

import os
import signal
import socket
import sys
import threading
import time
from contextlib import suppress
from types import FrameType
from typing import NoReturn

SIGNALS = (signal.SIGINT, signal.SIGTERM)
GRACE = 0.3  # [s] to leave what is running, and to remove what it has begun to write
SHOW_CURSOR = "\x1b[?25h"  # a progress display hides it

_requested = threading.Event()
_once = threading.Lock()
_message = "towline: stopped"
_arrived: int = signal.SIGINT  # which of the signals


def listen() -> None:
    """Let the signals end this process; call it in the main thread, before anything that takes long.

    One that is ignored stays ignored: the command was started under protection from it, as by the `&` of a script.
    """
    for each in SIGNALS:
        if signal.getsignal(each) is not signal.SIG_IGN:
            signal.signal(each, _interrupt)
    mine, woken = socket.socketpair()
    woken.setblocking(False)
    signal.set_wakeup_fd(woken.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_guard, args=(mine, woken), name="Ctrl-C", daemon=True).start()


def unlisten() -> None:
    """Leave Ctrl-C to Python again, for a command that it ends as it should."""
    if signal.getsignal(signal.SIGINT) is _interrupt:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def end_at_once(code: int) -> NoReturn:
    """End the process without waiting for its threads; all output is flushed."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def ignore() -> None:
    """Ignore the signals from here on: all is written, and one would only cut Python's shutdown short."""
    for each in SIGNALS:
        if signal.getsignal(each) is _interrupt:
            signal.signal(each, signal.SIG_IGN)
    signal.set_wakeup_fd(-1)  # last, so that nothing can arrive between the two


def add_to_message(text: str) -> None:
    """Set the text that an interrupt prints after "stopped", such as how to resume."""
    global _message
    _message = f"towline: stopped{text}"


def requested() -> bool:
    """Return whether one of the signals has arrived."""
    return _requested.is_set()


def end() -> NoReturn:
    """End the process with one line and the exit code of the signal; threads that still compute end with it."""
    while not _once.acquire(timeout=GRACE):  # never released: one line, whoever comes first
        pass
    execution = sys.modules.get("towline.base.execution")  # no process was started where it was never loaded
    if execution is not None:
        execution.end_processes()
    with suppress(OSError, ValueError):
        if sys.stderr.isatty():
            sys.stderr.write(SHOW_CURSOR)
        sys.stderr.write(f"{_message}\n")
        sys.stderr.flush()
    writing = sys.modules.get("towline.base.writing")  # nothing is being written where it was never loaded
    if writing is not None:
        writing.remove_unfinished()
    os._exit(128 + _arrived)


def _interrupt(signum: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, once: another one would only disturb the clean-up."""
    if not _requested.is_set():
        _quiet(signum)
        raise KeyboardInterrupt


def _quiet(signum: int) -> None:
    """Remember the signal, and keep Python from printing that it was swallowed."""
    global _arrived
    _arrived = signum
    _requested.set()
    sys.unraisablehook = lambda unraisable: None
    threading.excepthook = lambda failure: None


def _guard(mine: socket.socket, woken: socket.socket) -> None:
    """End the process a moment after a signal; `woken` is kept open by being an argument."""
    while True:
        signum = mine.recv(1)[0]
        if signal.getsignal(signum) is _interrupt:
            break
    time.sleep(GRACE)
    if not _requested.is_set():
        _quiet(signum)
    end()
