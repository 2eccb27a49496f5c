"""Long runs on workers and with a checkpoint: their options, and the hint how to resume after an interrupt."""

import os
import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import typer

from ..base.errors import InputError
from .stopping import add_to_message


def scheduler_option(when: str = "") -> Any:
    """Return --scheduler, with `when` it may be used, such as "With --runs: "."""
    text = f"{when}Dask scheduler to use instead of --workers, such as tcp://host:8786 (extra cluster)."
    return typer.Option(metavar="ADDRESS", help=_sentence(text))


def checkpoint_option(when: str = "") -> Any:
    """Return --checkpoint, with `when` it may be used."""
    text = f"{when}file in which to save progress; must not exist. Continue later with --resume."
    return typer.Option("--checkpoint", help=_sentence(text))


def resume_option(when: str = "") -> Any:
    """Return --resume, with `when` it may be used."""
    return typer.Option(
        "--resume", metavar="FILE", help=_sentence(f"{when}checkpoint to continue, or to create if it does not exist.")
    )


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:]


def check_unused(options: Mapping[str, object], without: str, many: str) -> None:
    """Raise InputError if an option is given, by its value, that is for `many` things and needs `without`."""
    for name, given in options.items():
        if given:
            raise InputError(f"{name} must be left out without {without}: it is an option for many {many}")


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
