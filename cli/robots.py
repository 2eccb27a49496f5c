"""`towline robots`: the library, or one robot with its diagnosis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options import JsonOption, print_json

if TYPE_CHECKING:
    from ..models import Robot
    from ..models.diagnosis import Diagnosis


def robots(
    name: Annotated[str | None, typer.Argument(metavar="[ROBOT]", help="A robot or robot file to diagnose.")] = None,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON Schema of robot files.")] = False,
    as_json: JsonOption = False,
) -> None:
    """List the robots of the library, or show one with its diagnosis: rank, limits, warnings."""
    from ..models import Robot, available, load

    if schema:
        print_json(Robot.model_json_schema())
    elif name is None:
        _list([load(known) for known in available()], as_json)
    else:
        from ..models.diagnosis import diagnose

        robot = load(name)
        found = _as_dict(robot, diagnose(robot))
        if as_json:
            print_json(found)
        else:
            _show(robot, found)


def _list(library: list[Robot], as_json: bool) -> None:
    rows = [
        {
            "name": robot.name,
            "cables": robot.m,
            "carriers": ", ".join(f"{n} {kind}" for kind, n in _kinds(robot).items()),
            "mass": robot.platform.mass,
            "source": robot.source.strip().splitlines()[0].strip(),
        }
        for robot in library
    ]
    if as_json:
        print_json({"robots": rows})
        return
    import textwrap

    from rich.console import Console
    from rich.table import Table

    table = Table("robot", "cables", "carriers", "mass [kg]", "source", box=None, pad_edge=False)
    for row in rows:
        source = textwrap.shorten(row["source"], 30, placeholder="...")
        table.add_row(row["name"], str(row["cables"]), row["carriers"], f"{row['mass']:g}", source)
    Console().print(table)


def _kinds(robot: Robot) -> dict[str, int]:
    kinds = [carrier.kind for carrier in robot.carriers]
    return {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)}


def _as_dict(robot: Robot, diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        "name": robot.name,
        "source": robot.source.strip(),
        "cables": robot.m,
        "carriers": _kinds(robot),
        "home": robot.home.tolist(),
        "mass": robot.platform.mass,
        "weight": robot.weight,
        "length": robot.length,
        "t_min": robot.t_min.tolist(),
        "t_max": robot.t_max.tolist(),
        "cable_lengths": diagnosis.lengths.tolist(),
        "singular_values": diagnosis.singular_values.tolist(),
        "rank": diagnosis.rank,
        "rank_level": diagnosis.rank_level,
        "rank_tilted": diagnosis.rank_tilted,
        "reason": diagnosis.reason,
        "warnings": diagnosis.warnings,
    }


def _show(robot: Robot, found: dict[str, Any]) -> None:
    carriers = ", ".join(f"{count} {kind}" for kind, count in found["carriers"].items())
    rank = f"{found['rank']} of 6 at home, {found['rank_level']} when level, {found['rank_tilted']} when tilted"
    lines = [
        f"{found['name']}: {found['cables']} cables; carriers: {carriers}",
        f"  mass {found['mass']:g} kg, weight {found['weight']:.4g} N, characteristic length {found['length']:.4g} m",
        f"  home ({_told(found['home'])}) m, rad; cables there {_range(found['cable_lengths'])} m long",
        f"  tension limits: t_min {_range(found['t_min'])} N, t_max {_range(found['t_max'])} N",
        f"  wrench matrix: rank {rank}" + (f": {found['reason']}" if found["reason"] else ""),
        f"  singular values, moments over that length: {_told(found['singular_values'])}",
        *(f"  warning: {warning}" for warning in found["warnings"]),
        "  source:",
        *(f"    {line.strip()}" for line in robot.source.strip().splitlines()),
    ]
    typer.echo("\n".join(lines))


def _told(values: list[float]) -> str:
    return ", ".join(f"{value:.4g}" for value in values)


def _range(values: list[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.4g}" if high - low < 1e-9 * max(abs(high), 1) else f"{low:.4g} to {high:.4g}"
