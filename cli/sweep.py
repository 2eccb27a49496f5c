"""The sweeps of `towline plan --vary`: many plans, one table and one figure."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import typer

from ..errors import InputError
from ..processors import one_thread_each
from .options import print_json
from .stopping import add_to_message
from .watching import counting

__all__ = ["Sweeping", "sweep"]


@dataclass(frozen=True)
class Sweeping:
    """The options of a sweep."""

    vary: list[str]
    workers: int
    scheduler: str | None
    checkpoint: Path | None
    resume: Path | None
    keep: Path | None


def sweep(robot: str, task: Path, options: Sweeping, out: Path | None, figures: Path | None, as_json: bool) -> None:
    """Plan all combinations, save the table, draw and print it; exit code 1 if no plan is feasible."""
    # Before libraries load: a plan must not depend on the number of threads, nor on that of processes.
    with one_thread_each():
        _sweep(robot, task, options, out, figures, as_json)


def _sweep(robot: str, task: Path, options: Sweeping, out: Path | None, figures: Path | None, as_json: bool) -> None:
    from ..models import load
    from ..ocp import read_task
    from ..ocp import sweep as sweep_plans
    from ..ocp.sweeps.axis import check_figure, read_axes, read_option
    from ..writing import check_writable

    checkpoint, resume = options.checkpoint, options.resume
    if checkpoint is not None and resume is not None:
        raise InputError(f"--checkpoint must not be given with --resume, got {checkpoint} and {resume}")
    loaded, read = load(robot), read_task(task)
    vary = read_option(options.vary)
    target = out if out is not None else Path(f"{loaded.name}-{read.name}-sweep.nc")
    if target.suffix == ".csv":
        raise InputError(f"--out must be a NetCDF file, beside which the CSV is written, got {target}")
    picture = None if figures is None else figures / "sweep.png"
    if picture is not None:
        check_figure(read_axes(vary))
    taken = None if (stored := checkpoint or resume) is None else stored.resolve()
    for what, file in (("--out", target), ("--out", target.with_suffix(".csv")), ("--figures", picture)):
        if file is not None and check_writable(file) == taken:
            raise InputError(f"{what} must be another file than the checkpoint, got {file}")
    with counting(f"planning {read.name}", "feasible", quiet=as_json) as show:
        result = sweep_plans(
            loaded,
            read,
            vary,
            workers=options.workers,
            scheduler=options.scheduler,
            checkpoint=stored,
            resume=resume is not None,
            keep=options.keep,
            progress=_resumable(show, stored),
        )
    add_to_message("")
    files = list(result.save(target))
    if picture is not None:
        from ..figures import style

        files.append(style.save(result.figure(), picture))
    if as_json:
        drawn = None if picture is None else str(picture)
        kept = None if options.keep is None else str(options.keep)
        written = {"file": str(files[0]), "csv": str(files[1]), "figure": drawn, "plans_in": kept}
        print_json({**result.to_dict(), **written})
    else:
        typer.echo(result.report())
        typer.echo("  Written")
        for path in (*files, *([options.keep] if options.keep is not None else [])):
            typer.echo(f"    {path}")
    if not result.feasible:
        raise typer.Exit(1)


def _resumable(show: Callable[[int, int, int], None], checkpoint: Path | None) -> Callable[[int, int, int], None]:
    """Return a function that shows progress, and keeps the line for Ctrl-C true."""

    def progress(done: int, total: int, feasible: int) -> None:
        show(done, total, feasible)
        if checkpoint is not None:
            more = f"to continue, repeat the command with --resume {shlex.quote(str(checkpoint))}"
        else:
            more = "the table is lost: only --checkpoint and --resume store it"
        add_to_message(f" after {done} of {total} plans; {more}")

    return progress
