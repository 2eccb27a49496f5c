"""The command `towline`: from its first import on Ctrl-C ends it."""

from __future__ import annotations

from .stopping import end, ignore, listen, requested


def main() -> None:
    """Run the command line."""
    try:
        try:
            listen()
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
