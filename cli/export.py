"""`towline export`: a robot for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import JsonOption, RobotArgument, print_json


def export(
    robot: RobotArgument,
    mjcf: Annotated[bool, typer.Option("--mjcf", help="Write a MuJoCo model.")] = False,
    c_code: Annotated[
        bool, typer.Option("--c", help="Write the functions of the dynamics as C code without dependencies.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="File to write; default: ROBOT.xml or ROBOT.c in this folder, from the robot's `name`.",
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Export a robot as a MuJoCo model (--mjcf) or as C code (--c)."""
    from ..errors import InputError
    from ..models import load
    from ..writing import check_writable, whole_file

    if mjcf == c_code:
        raise InputError("export requires exactly one of --mjcf and --c")
    loaded = load(robot)
    path = out or Path(f"{loaded.name}{'.xml' if mjcf else '.c'}")
    check_writable(path)
    if mjcf:
        from ..models.mjcf import to_mjcf

        text = to_mjcf(loaded)
    else:
        from ..models.c_code import to_c

        text = to_c(loaded)
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    if as_json:
        print_json({"robot": loaded.name, "file": path})
    else:
        typer.echo(str(path))
