"""`towline time`: the fastest time law along a task's path."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from .options import JsonOption, RobotArgument, print_json

if TYPE_CHECKING:
    from ..ocp import Task


def time(
    robot: RobotArgument,
    task: Annotated[Path, typer.Argument(metavar="TASK", help="A task file (YAML); its duration is not asked for.")],
    out: Annotated[
        Path | None, typer.Option("--out", help="Task file of the timed motion to write; none: ROBOT-TASK-timed.yaml.")
    ] = None,
    grid: Annotated[int, typer.Option(help="Intervals of the path to start with.")] = 200,
    carrier_speed: Annotated[
        float | None, typer.Option(help="Most of each carrier that moves [m/s]; none: the robot file's.")
    ] = None,
    carrier_acceleration: Annotated[float | None, typer.Option(help="Likewise [m/s^2].")] = None,
    as_json: JsonOption = False,
) -> None:
    """Find the fastest motion along a path with every tension inside its limits, or where there is none (exit code 1).

    Of the task count its path, the places or paths of its carriers, its margin, still air, and the limits of platform
    and cable speed. `towline plan` audits the file that is written as any task.
    """
    from ..models import load
    from ..ocp import read_task, time_along
    from ..writing import check_writable

    loaded, read = load(robot), read_task(task)
    target = out if out is not None else Path(f"{loaded.name}-{read.name}-timed.yaml")
    check_writable(target)
    arguments = _arguments(read)
    found = time_along(
        loaded,
        read.path,
        **arguments,
        grid=grid,
        carrier_speed_max=carrier_speed,
        carrier_acceleration_max=carrier_acceleration,
    )
    file = found.save_task(target, f"{read.name[:54]}-timed") if found.feasible else None
    if as_json:
        print_json({**found.summary(), "file": None if file is None else str(file)})
    else:
        typer.echo(found.report())
        if file is not None:
            typer.echo(f"  Written\n    {file}")
    if not found.feasible:
        raise typer.Exit(1)


def _arguments(task: Task) -> dict[str, Any]:
    """What a task says of the arguments of `time_along`.

    Raises
    ------
    InputError
        If it leaves more open than the pace, or limits what no time law along a path can be told.
    """
    where, base = f"task {task.name!r}", task.base
    if base.kind == "free":
        raise InputError(f"{where}: base.kind: 'free' leaves more open than the pace; accepted: hold, given")
    if task.tube.radius or task.tube.turn:
        raise InputError(f"{where}: tube: leaves more open than the pace; accepted: none, the path is followed exactly")
    known = ("platform_speed", "cable_speed")
    for name in type(task.limits).model_fields:
        if name not in (*known, "soft") and getattr(task.limits, name):
            raise InputError(f"{where}: limits.{name}: is none that timing knows; accepted: {', '.join(known)}")
    if task.limits.soft:
        raise InputError(f"{where}: limits.soft: timing knows hard limits only; accepted: none")
    if task.wind is not None and not isinstance(task.wind, tuple):
        raise InputError(f"{where}: wind: is a box, and timing knows still air only; accepted: none, or [0, 0, 0]")
    turns = task.path.kind == "circle" and isinstance(task.duration, float)
    return {
        "margin": task.margin,
        "carriers": base.paths
        if base.kind == "given"
        else {name: {"kind": "rest", "pose": pose} for name, pose in base.poses.items()},
        "until": task.duration if turns else None,
        "speed_max": task.limits.platform_speed,
        "cable_speed_max": task.limits.cable_speed,
        "wind": task.wind,
    }
