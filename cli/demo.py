"""`towline demo`: plan a circle of the flying cable robot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import JsonOption, print_json, print_written
from .watching import watching


def demo(
    folder: Annotated[Path, typer.Option("--out", help="Folder for pictures and files.")] = Path("towline-demo"),
    as_json: JsonOption = False,
) -> None:
    """Plan a circle of the flying cable robot: impossible while the quadrotor hovers, feasible if it moves."""
    from ..studies.flying import circle as flying_circle

    with watching("planning the circle with a quadrotor that may move", quiet=as_json) as progress:
        result = flying_circle.run(folder, progress)
    written = [*result.pictures, *result.files]
    if as_json:
        halves = {"hovering": result.hovering.to_dict(), "free": result.free.to_dict()}
        print_json({"as_expected": result.as_expected, **halves, "files": written})
    else:
        typer.echo("A circle of radius 1 m at a height of 99 m, under a quadrotor that hovers at 100 m:\n")
        typer.echo(result.hovering.report())
        typer.echo("\nThe same circle with a quadrotor that may move, with acceleration up to 3 m/s^2:\n")
        typer.echo(result.free.report())
        print_written(written)
    if not result.as_expected:
        raise typer.Exit(1)
