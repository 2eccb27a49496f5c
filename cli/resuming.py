"""Long runs on workers and with a checkpoint: their options, and the hint how to resume after an interrupt."""

import os
import shlex
from collections.abc import Callable
from pathlib import Path

from ..base.errors import InputError
from .stopping import add_to_message


def long_run(when: str = "") -> str:
    """Return the entries of --workers, --scheduler, --checkpoint and --resume for `parameters`.

    `when`: when they may be used, such as "With --runs: ".
    """
    entries = {
        "workers": f"{when}number of processes on this machine.",
        "scheduler ADDRESS": f"{when}Dask scheduler to use instead of --workers, such as tcp://host:8786 "
        "(extra cluster).",
        "checkpoint": f"{when}file in which to save progress; must not exist. Continue later with --resume.",
        "resume FILE": f"{when}checkpoint to continue, or to create if it does not exist.",
    }
    return "\n".join(f"    --{name}: {text[0].upper()}{text[1:]}" for name, text in entries.items())


def checkpoint_of(checkpoint: Path | None, resume: Path | None) -> Path | None:
    """Return the file of --checkpoint or --resume.

    Raises `InputError` if both are given.
    """
    if checkpoint is not None and resume is not None:
        raise InputError(f"--checkpoint must not be given with --resume, got {checkpoint} and {resume}")
    return checkpoint or resume


def resumable(
    show: Callable[[int, int, int], None], checkpoint: str | os.PathLike[str] | None, unit: str
) -> Callable[[int, int, int], None]:
    """Return a function that shows progress in `unit`, such as "plans", and keeps the line for Ctrl-C true."""
    if checkpoint is not None:
        more = f"to continue, repeat the command with --resume {shlex.quote(str(checkpoint))}"
        add_to_message(f"; {more}")  # before the first result
    else:
        more = "they are lost: only --checkpoint and --resume save them"

    def progress(done: int, total: int, counted: int) -> None:
        show(done, total, counted)
        add_to_message(f" after {done} of {total} {unit}; {more}")

    return progress
