"""`towline plan`: a trajectory for a robot and a task file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import JsonOption, RobotArgument, print_json
from .watching import watching


def _print_schema(requested: bool) -> None:
    if requested:
        from ..ocp import Task

        print_json(Task.model_json_schema())
        raise typer.Exit


def plan(
    robot: RobotArgument,
    task: Annotated[Path, typer.Argument(metavar="TASK", help="A task file (YAML).")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="NetCDF file to write; default: ROBOT-TASK.nc in this folder, from the `name` keys of both files. An "
            "existing file is overwritten.",
        ),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(
            "--figures",
            help="Folder to draw in: path, views, tensions and, where they apply, carriers (base.png), limits and the "
            "solver's convergence.",
        ),
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", help="HTML file to write: the report with its figures, to open anywhere.")
    ] = None,
    animate: Annotated[
        Path | None, typer.Option("--animate", help="Film of the robot to write: .gif, or .mp4 with ffmpeg.")
    ] = None,
    speed: Annotated[float, typer.Option(help="Speed of the film; 1 is real time.")] = 1.0,
    fps: Annotated[float, typer.Option(help="Frames per second of the film.")] = 20.0,
    as_json: JsonOption = False,
    schema: Annotated[
        bool,
        typer.Option("--schema", callback=_print_schema, is_eager=True, help="Print the JSON Schema of task files."),
    ] = False,
) -> None:
    """Plan a motion that keeps every tension inside its limits, or report why none exists."""
    from ..models import load
    from ..ocp import plan as plan_motion
    from ..ocp import read_task
    from ..writing import check_writable

    loaded, read = load(robot), read_task(task)
    target = out if out is not None else Path(f"{loaded.name}-{read.name}.nc")
    if animate is not None:
        from ..figures.animation import check_film

        check_film(animate, speed, fps)
    for file in (target, report, animate, figures and figures / "path.png"):
        if file is not None:
            check_writable(file)
    with watching(f"planning {read.name}", quiet=as_json) as watch:
        planned = plan_motion(loaded, read, watch)
        written = {"file": planned.save(target)}
        watch.now("drawing")
        pictures = planned.plot(figures) if figures else []
        if report is not None:
            written["report"] = planned.save_report(report)
        if animate is not None:
            written["animation"] = planned.animate(animate, speed, fps)
    if as_json:
        files = {name: str(path) for name, path in written.items()}
        print_json({**planned.to_dict(), **files, "figures": [str(picture) for picture in pictures]})
    else:
        typer.echo(planned.report())
        typer.echo("  Written")
        for path in (*written.values(), *pictures):
            typer.echo(f"    {path}")
    if not planned.feasible:
        raise typer.Exit(1)
