"""`towline demo`: plan a circle of the flying cable robot, and simulate it."""

from pathlib import Path

import typer

from .options import FormatOption, JsonOption, parameters, print_json, print_written
from .watching import watching


@parameters("""
    --out: Folder for pictures and files.
""")
def demo(folder: Path = Path("towline-demo"), form: FormatOption = "png", as_json: JsonOption = False) -> None:
    """Plan a circle of the flying cable robot and simulate it in wind.

    The circle is infeasible while the quadrotor hovers, and feasible if it moves. The exit code is 0 if the plans show
    this and the simulation passes.
    """
    from ..studies.flying import circle as flying_circle

    with watching("planning the circle with a quadrotor that may move", quiet=as_json) as progress:
        result = flying_circle.run(folder, progress, form)
    # Reports and files of the plans come before the flight: Ctrl-C loses none of them.
    if not as_json:
        typer.echo("A circle of radius 1 m at a height of 99 m, under a quadrotor that hovers at 100 m:\n")
        typer.echo(result.hovering.report())
        typer.echo("\nThe same circle with a quadrotor that may move, with acceleration up to 3 m/s^2:\n")
        typer.echo(result.free.report())
        print_written([*result.pictures, *result.files])
        typer.echo(
            f"\nThis plan, simulated in wind of {flying_circle.WIND} m/s with gusts of {flying_circle.GUSTS} m/s:\n"
        )
    with watching("simulating the circle in wind", quiet=as_json):
        flight, flown = flying_circle.fly(folder, result.free, form)
    passed = result.as_expected and flight.passed
    if as_json:
        parts = {"hovering": result.hovering.to_dict(), "free": result.free.to_dict(), "simulation": flight.to_dict()}
        print_json({"as_expected": passed, **parts, "files": [*result.pictures, *result.files, *flown]})
    else:
        typer.echo(flight.report().splitlines()[0])
        print_written(flown)
    if not passed:
        raise typer.Exit(1)
