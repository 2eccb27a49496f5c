"""`towline plan`: a trajectory for a robot and a task file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import JsonOption, RobotArgument, print_json, watching


def plan(
    robot: RobotArgument,
    task: Annotated[Path, typer.Argument(metavar="TASK", help="A task file (YAML).")],
    out: Annotated[
        Path | None, typer.Option("--out", help="NetCDF file to write; none: ROBOT-TASK.nc in this folder.")
    ] = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", help="Folder to draw path, tensions and base in.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Plan a motion that keeps every tension inside its limits, or say why there is none."""
    from ..models import load
    from ..ocp import plan as plan_motion
    from ..ocp import read_task
    from ..writing import check_writable

    loaded, read = load(robot), read_task(task)
    target = out if out is not None else Path(f"{loaded.name}-{read.name}.nc")
    check_writable(target)
    with watching(f"planning {read.name}") as progress:
        found = plan_motion(loaded, read, progress)
    file = found.save(target)
    pictures = found.plot(figures) if figures else []
    if as_json:
        print_json({**found.summary(), "file": str(file), "figures": [str(picture) for picture in pictures]})
    else:
        typer.echo(found.report())
        for path in (file, *pictures):
            typer.echo(f"  {path}")
    if not found.feasible:
        raise typer.Exit(1)
