"""`towline time`: the fastest time law along a task's path."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import JsonOption, RobotArgument, print_json


def time(
    robot: RobotArgument,
    task: Annotated[Path, typer.Argument(metavar="TASK", help="A task file (YAML); its duration is ignored.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Task file to write, of the timed motion; default: ROBOT-TASK-timed.yaml."),
    ] = None,
    grid: Annotated[int, typer.Option(help="Intervals of the path to start with.")] = 200,
    as_json: JsonOption = False,
) -> None:
    """Find the fastest motion along a task's path with every tension inside its limits; exit code 1 if there is none.

    The task gives the path, the places or paths of the carriers, the margin, still air, and the limits of platform and
    cable speed and of carrier speed and acceleration. `towline plan` audits the file that is written, as any task.
    """
    from ..models import load
    from ..ocp import read_task, time_along
    from ..writing import check_writable

    loaded, read = load(robot), read_task(task)
    target = out if out is not None else Path(f"{loaded.name}-{read.name}-timed.yaml")
    check_writable(target)
    timing = time_along(loaded, read, grid=grid)
    file = timing.save_task(target, f"{read.name[:54]}-timed") if timing.feasible else None
    if as_json:
        print_json({**timing.to_dict(), "file": None if file is None else str(file)})
    else:
        typer.echo(timing.report())
        if file is not None:
            typer.echo(f"  Written\n    {file}")
    if not timing.feasible:
        raise typer.Exit(1)
