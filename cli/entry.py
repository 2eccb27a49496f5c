"""The command `towline`: from its first import on Ctrl-C ends it."""

from __future__ import annotations

import gc

from .stopping import end, ignore, listen, requested

OBJECTS = 50_000  # by which they must have grown before Python looks for rubbish: at its 700 a start takes 6 % longer


def main() -> None:
    """Run the command line."""
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


if __name__ == "__main__":
    main()
