"""`towline robots`: the library, or one robot with its diagnosis."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options import JsonOption, print_json

if TYPE_CHECKING:
    from ..models import Robot
    from ..models.diagnosis import Diagnosis
    from ..solvers import TensionSolution


def robots(
    name: Annotated[str | None, typer.Argument(metavar="[ROBOT]", help="A robot or robot file to diagnose.")] = None,
    figure: Annotated[Path | None, typer.Option(help="Draw the robot into this PNG file.")] = None,
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
        from ..distribution import pose_problem
        from ..models import Dynamics
        from ..models.diagnosis import diagnose
        from ..solvers import solve

        robot = load(name)
        at_home = solve(pose_problem(Dynamics(robot), robot.home))
        found = _to_dict(robot, diagnose(robot), at_home)
        if figure is not None:
            _draw(robot, at_home, figure)
            found["figure"] = str(figure)
        if as_json:
            print_json(found)
        else:
            _show(robot, found, at_home)


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
    from rich.console import Console
    from rich.table import Table

    table = Table("robot", "cables", "carriers", "mass [kg]", box=None, pad_edge=False)
    for row in rows:
        table.add_row(row["name"], str(row["cables"]), row["carriers"], f"{row['mass']:g}")
    Console().print(table)


def _kinds(robot: Robot) -> dict[str, int]:
    kinds = [carrier.kind for carrier in robot.carriers]
    return {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)}


def _to_dict(robot: Robot, diagnosis: Diagnosis, at_home: TensionSolution) -> dict[str, Any]:
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
        "at_home": at_home.to_dict(),
    }


def _show(robot: Robot, found: dict[str, Any], at_home: TensionSolution) -> None:
    carriers = ", ".join(f"{count} {kind}" for kind, count in found["carriers"].items())
    moves = len(robot.platform.dof)
    rank = f"{found['rank']} of {moves} at home, {found['rank_level']} when level, {found['rank_tilted']} when tilted"
    lines = [
        f"{found['name']}: {found['cables']} cables; carriers: {carriers}",
        f"  mass {found['mass']:g} kg, weight {found['weight']:.4g} N, characteristic length {found['length']:.4g} m",
        f"  home ({_told(found['home'])}) m, rad; cables there {_range(found['cable_lengths'])} m long",
        f"  tension limits: t_min {_range(found['t_min'])} N, t_max {_range(found['t_max'])} N",
        f"  wrench matrix: rank {rank}" + (f": {found['reason']}" if found["reason"] else ""),
        f"  singular values, moments over that length: {_told(found['singular_values'])}",
        *_rest(at_home),
        *(f"  warning: {warning}" for warning in found["warnings"]),
        "  source:",
        *(f"    {line.strip()}" for line in robot.source.strip().splitlines()),
    ]
    typer.echo("\n".join(lines))


def _rest(at_home: TensionSolution) -> list[str]:
    """Whether the robot can rest at home, or the proof that it cannot."""
    if at_home.tensions is not None:
        return [f"  at rest at home: tensions {_range(at_home.tensions.tolist())} N ({at_home.status.value})"]
    lines = [f"  cannot rest at home ({at_home.status.value})"]
    if at_home.certificate is not None:
        lines += [f"    {line}" for line in at_home.certificate.describe().splitlines()]
    return lines


def _draw(robot: Robot, at_home: TensionSolution, file: Path) -> None:
    import numpy as np

    from ..figures import robot as figure
    from ..figures import style
    from ..models import Dynamics
    from ..models.robot import MobileCarrier
    from ..workspace import hints

    reach = [carrier.reach for carrier in robot.carriers if isinstance(carrier, MobileCarrier)]
    positions, feasible = hints(Dynamics(robot))
    sketch = figure.RobotSketch(
        title=robot.name,
        anchors=robot.home_anchors,
        attachments=robot.home_attachments,
        com=robot.home_com,
        carriers=robot.carrier_home[:, :3],
        names=[carrier.name for carrier in robot.carriers],
        boxes=[(np.array(box.min), np.array(box.max)) for box in reach],
        tensions=at_home.tensions,
        positions=positions,
        feasible=feasible,
    )
    style.save(figure.draw(sketch), file)


def _told(values: list[float]) -> str:
    return ", ".join(f"{value:.4g}" for value in values)


def _range(values: list[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.4g}" if high - low < 1e-9 * max(abs(high), 1) else f"{low:.4g} to {high:.4g}"
