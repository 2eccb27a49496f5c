"""Show progress live on standard error, and how to resume long runs after an interrupt."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import InputError
from ..base.text import quantity
from .stopping import add_to_message

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID


@contextmanager
def progress_bar(what: str, quiet: bool) -> Iterator[Callable[..., None]]:
    """Show a bar with rate and remaining time while the block runs, on a terminal and unless `quiet`.

    The block receives a function that moves the bar, of (what is being done, done, total) and, if there are, details.
    """
    # Rich takes longer to load than a short plan to compute.
    if quiet or not sys.stderr.isatty():
        yield lambda what, done, total, detail="": None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    what_is_done, details = (TextColumn(f"{{task.{name}}}", markup=False) for name in ("description", "fields[detail]"))
    columns = (what_is_done, BarColumn(bar_width=20), TaskProgressColumn(), details, TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        line = shown.add_task(what, detail="", total=None)

        def move(what: str, done: int, total: int, detail: str = "") -> None:
            rate = shown.tasks[line].speed or shown.tasks[line].finished_speed or 0.0
            detail = f"{rate:,.0f}/s  {detail}" if rate >= 1 else detail
            shown.update(line, description=what, completed=done, total=total, detail=detail)

        yield move


class Watch:
    """A display of a solver's progress."""

    def __init__(self, shown: Progress | None, what: str):
        self.rows: list[tuple[int, float, float]] = []  # all rows received: (iteration, objective, infeasibility)
        self.attempt = 1  # number of the solver's runs: another one begins where the iteration number falls back
        self._shown = shown
        self._line: TaskID | None = None if shown is None else shown.add_task(what, detail="preparing", total=None)

    def __call__(self, iteration: int, objective: float, infeasibility: float) -> None:
        """Show one iteration."""
        if self.rows and iteration <= self.rows[-1][0]:
            self.attempt += 1
        self.rows.append((iteration, objective, infeasibility))
        detail = f"attempt {self.attempt}  iteration {iteration:<3}  "
        detail += f"objective {quantity(objective):<9}  infeasibility {infeasibility:.1e}"
        self._update(detail=detail)

    def now(self, what: str) -> None:
        """Show the next step, without iterations."""
        self._update(description=what, detail="")

    def _update(self, **shown: Any) -> None:
        if self._shown is not None and self._line is not None:
            self._shown.update(self._line, **shown)


@contextmanager
def watching(what: str, quiet: bool = False, console: Console | None = None) -> Iterator[Watch]:
    """Show a solver's iterations while the block runs, on a terminal and unless `quiet`; default: standard error."""
    # Rich takes longer to load than a short plan to compute.
    if quiet or (console is None and not sys.stderr.isatty()):
        yield Watch(None, what)
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    to = console or Console(stderr=True)
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}\n{task.fields[detail]}", markup=False),  # together too wide for 80 columns
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=to, transient=True, disable=not to.is_terminal) as shown:
        yield Watch(shown, what)


@contextmanager
def counting(what: str, counted: str, quiet: bool = False) -> Iterator[Callable[[int, int, int], None]]:
    """Show a `progress_bar` for what is counted, such as "accepted" or "feasible", while the block runs.

    The block receives a function of (how many are done, how many there are, how many of those done are counted).
    """
    with progress_bar(what, quiet) as move:
        yield lambda done, total, count: move(what, done, total, f"{counted} {count / max(done, 1):.2%}")


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
