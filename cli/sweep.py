"""The sweeps of `towline plan --vary`: many plans, one table and one figure."""

from dataclasses import dataclass
from pathlib import Path

import typer

from ..base.errors import InputError
from ..base.inputs import check_ending
from ..base.processors import one_thread_each
from .options import print_json
from .outputs import check_outputs
from .resuming import checkpoint_of, resumable
from .stopping import add_to_message
from .watching import counting


@dataclass(frozen=True)
class Sweeping:
    """The options of a sweep."""

    vary: list[str]
    workers: int
    scheduler: str | None
    checkpoint: Path | None
    resume: Path | None
    keep: Path | None
    form: str


def sweep(robot: str, task: Path, options: Sweeping, out: Path | None, figures: Path | None, as_json: bool) -> None:
    """Plan all combinations, save, draw and print the table; the exit code is 1 if no plan is feasible."""
    # Before libraries load: a plan must not depend on the number of threads, nor on that of processes.
    with one_thread_each():
        _sweep(robot, task, options, out, figures, as_json)


def _sweep(robot: str, task: Path, options: Sweeping, out: Path | None, figures: Path | None, as_json: bool) -> None:
    from ..models import load
    from ..ocp import read_task
    from ..ocp import sweep as sweep_plans
    from ..ocp.sweeps.axis import check_figure, read_axes, read_option

    stored = checkpoint_of(options.checkpoint, options.resume)
    loaded, read = load(robot), read_task(task)
    vary = read_option(options.vary)
    target = out if out is not None else Path(f"{loaded.name}-{read.name}-sweep.nc")
    if target.suffix == ".csv":
        raise InputError(f"--out must be a NetCDF file (.nc), got {target}")
    check_ending("--out", target, ".nc")
    picture = None if figures is None else figures / f"sweep.{options.form}"
    if picture is not None:
        check_figure(read_axes(vary))
    table = {"--out": target, "the CSV file of --out": target.with_suffix(".csv")}
    check_outputs({"the checkpoint": stored, **table, "--figures": picture})
    with counting(f"planning {read.name}", "feasible", quiet=as_json) as show:
        result = sweep_plans(
            loaded,
            read,
            vary,
            workers=options.workers,
            scheduler=options.scheduler,
            checkpoint=stored,
            resume=options.resume is not None,
            keep=options.keep,
            progress=resumable(show, stored, "plans"),
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
