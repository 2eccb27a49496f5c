"""The command `towline`: from its first import on Ctrl-C and SIGTERM end it."""

import gc
import os
import signal
import sys
from types import FrameType
from typing import NoReturn

OBJECTS = 50_000  # by which they must have grown before Python looks for rubbish: at its 700 a start takes 6 % longer


def main() -> None:
    """Run the command line."""
    _open_streams()
    for each in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(each) is not signal.SIG_IGN:
            signal.signal(each, _at_once)  # while what listens is imported
    from .stopping import end, ignore, listen, requested

    try:
        try:
            listen()
            gc.set_threshold(OBJECTS)
            from .main import main as run

            run()
        finally:
            ignore()
    except BaseException:
        if requested():
            end()
        raise


def _open_streams() -> None:
    """Open the standard streams that are closed, as of a daemon; another file would take their numbers."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115 - as long as the process lasts


def _at_once(signum: int, frame: FrameType | None) -> NoReturn:
    """End the process with the line and the exit code of an interrupt; nothing has begun that needs cleaning up."""
    os.write(2, b"towline: stopped\n")
    os._exit(128 + signum)


if __name__ == "__main__":
    main()
