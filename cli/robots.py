"""`towline robots`: the library, or one robot with its diagnosis."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options import JsonOption, parameters, print_json, print_table, print_written, robot_names
from .outputs import check_outputs

if TYPE_CHECKING:
    from ..models import Robot
    from ..models.diagnosis import Diagnosis
    from ..solvers import TensionSolution
    from ..workspace.resting_box import RestingBox

MOVES = {
    "both": "winches change the cable lengths, and carriers may move too",
    "fixed-length": "carriers move, and the cable lengths are constant",
    "variable-length": "winches change the cable lengths, and mobile carriers stay where they are",
    "winches": "winches change the cable lengths",  # "both", where no carrier can move
}


@parameters("""
    --figure FILE: File for a picture of the robot: .png, .pdf or .svg.
    --schema: Print the JSON Schema of robot files.
""")
def robots(
    name: Annotated[
        str | None,
        typer.Argument(metavar="ROBOT", help="A robot or robot file to diagnose.", autocompletion=robot_names),
    ] = None,
    figure: Path | None = None,
    schema: bool = False,
    as_json: JsonOption = False,
) -> None:
    """List the robots of the library, or diagnose one.

    The diagnosis gives the rank of the wrench matrix (with the cause of a deficient one), the tensions at rest at home
    or the proof that none exist, a box of positions at which the platform can rest, and warnings about implausible
    numbers.
    """
    if schema:
        from ..models import Robot

        print_json(Robot.model_json_schema())
    elif name is None:
        from ..models.library import contents

        _list(contents(), as_json)
    else:
        from ..models import Dynamics, load
        from ..models.diagnosis import diagnose
        from ..solvers import solve
        from ..statics.distribution import pose_problem
        from ..workspace.resting_box import resting_box

        robot = load(name)
        check_outputs({"--figure": figure})
        at_home = solve(pose_problem(Dynamics(robot), robot.home))
        box = resting_box(robot)
        result = _to_dict(robot, diagnose(robot), at_home, box)
        if figure is not None:
            from ..figures import style
            from ..figures.robot import draw
            from ..statics.scene import scene_at

            scene = scene_at(robot, robot.home, at_home.tensions, robot.name)
            style.save(draw(scene, None if box is None else box.resting), figure)
            result["figure"] = figure
        if as_json:
            print_json(result)
        else:
            _show(robot, result, at_home, box)
            if figure is not None:
                print_written([figure])


def _list(library: list[dict[str, Any]], as_json: bool) -> None:
    from ..base.text import quantity

    rows: list[dict[str, Any]] = [{**robot, "carriers": _count(robot["carriers"])} for robot in library]
    if as_json:
        print_json({"robots": rows})
        return
    print_table(
        ("robot", "cables", "carriers", "mass"),
        [(row["name"], str(row["cables"]), row["carriers"], quantity(row["mass"], "kg")) for row in rows],
        "lrlr",
    )


def _count(kinds: dict[str, int]) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in kinds.items())


def _to_dict(robot: Robot, diagnosis: Diagnosis, at_home: TensionSolution, box: RestingBox | None) -> dict[str, Any]:
    kinds = [carrier.kind for carrier in robot.carriers]
    resting = None
    if box is not None:
        resting = {"min": box.low.tolist(), "max": box.high.tolist(), "about": box.centre.tolist()}
        resting |= {"samples": box.samples, "spacing": box.spacing.tolist()}
    return {
        "name": robot.name,
        "source": robot.source.strip(),
        "cables": robot.m,
        "carriers": {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)},
        "home": robot.home.tolist(),
        "mass": robot.platform.mass,
        **{name: getattr(robot, name) for name in ("drive", "weight", "length")},
        "t_min": robot.t_min.tolist(),
        "t_max": robot.t_max.tolist(),
        "cable_lengths": diagnosis.lengths.tolist(),
        "singular_values": diagnosis.singular_values.tolist(),
        **{name: getattr(diagnosis, name) for name in ("rank", "rank_level", "rank_tilted", "reason", "warnings")},
        "at_home": at_home.to_dict(),
        "resting_box": resting,
    }


def _show(robot: Robot, result: dict[str, Any], at_home: TensionSolution, box: RestingBox | None) -> None:
    from ..base.text import counted, quantity, quantity_range, quantity_row

    of = f"of {len(robot.platform.dof)}"
    highest = f"{result['rank_level']} if the platform is level, {result['rank_tilted']} if it is tilted"
    reason = f" ({result['reason']})" if result["reason"] else ""
    rank = f"rank {result['rank']} {of} at home{reason}"
    if result["rank"] < len(robot.platform.dof):
        rank += f"; highest rank near home: {highest}"
        if max(result["rank_level"], result["rank_tilted"]) < len(robot.platform.dof) <= robot.m:
            rank += "\n    cross the cables, or list in platform.dof only the coordinates that they can control"
    drive = "winches" if robot.drive == "both" and not any(carrier.moves for carrier in robot.carriers) else robot.drive
    carriers = f"{_count(result['carriers'])} carrier{'s' * (len(robot.carriers) != 1)}"
    lines = [
        f"{result['name']}: {counted(robot.m, 'cable')}, {carriers}",
        f"  mass {quantity(result['mass'], 'kg')}, weight {quantity(result['weight'], 'N')}, "
        f"characteristic length {quantity(result['length'], 'm')}",
        f"  home ({quantity_row(result['home'])}) [m, rad], cable lengths there "
        f"{quantity_range(result['cable_lengths'], 'm')}",
        f"  drive {robot.drive}: {MOVES[drive]}",
        f"  tension limits: t_min {quantity_range(result['t_min'], 'N')}, t_max {quantity_range(result['t_max'], 'N')}",
        f"  wrench matrix: {rank}",
        f"  its singular values, moments divided by the characteristic length: "
        f"{quantity_row(result['singular_values'])}",
        *_rest(at_home),
        *_box(robot, box),
        *(f"  warning: {warning}" for warning in result["warnings"]),
        "  source:",
        *(f"    {line.strip()}" for line in robot.source.strip().splitlines()),
    ]
    typer.echo("\n".join(lines))


def _rest(at_home: TensionSolution) -> list[str]:
    """Return the tensions that hold the robot at home, or the proof that none exist."""
    from ..base.text import quantity_range

    if at_home.tensions is not None:
        tensions = quantity_range(at_home.tensions.tolist(), "N")
        return [f"  at rest at home: tensions {tensions} ({at_home.status.value})"]
    lines = [f"  cannot rest at home ({at_home.status.value})"]
    if at_home.certificate is not None:
        lines += [f"    {line}" for line in at_home.certificate.describe().splitlines()]
    return lines


def _box(robot: Robot, box: RestingBox | None) -> list[str]:
    """Return where the platform can rest, and how that was sampled."""
    import numpy as np

    from ..base.text import quantity, quantity_range, quantity_row

    movable, attitude = any(carrier.moves for carrier in robot.carriers), "in its home attitude"
    held = f"{attitude} and with its carriers at home" if movable else attitude
    if box is None:
        hint = ["    (in a plan with `base: {kind: free}` the carriers can move too)"] if movable else []
        unknown = "no box of positions at which it can rest is known, with the carriers placed as at home"
        sampled = f"cannot rest, {held}, at any of the sampled positions"
        return [f"  {sampled if robot.fixed_lengths is None else unknown}", *hint]
    sides = [
        f"{'xyz'[axis]} {quantity_range([box.low[axis], box.high[axis]], 'm', 3)}"
        if np.isfinite(box.high[axis])
        else f"{'xyz'[axis]} at least {quantity(box.low[axis], 'm', 3)}"
        for axis in np.flatnonzero(robot.dof_mask[:3])
        if np.isfinite(box.low[axis])
    ]
    if not box.samples:
        box_or_half_space = "in the box" if np.isfinite(box.high[robot.dof_mask[:3] > 0]).all() else "anywhere with"
        where = f"{box_or_half_space} {', '.join(sides)}" if sides else "at any position"
        return [
            f"  can rest, {attitude}, {where}",
            "    (the carriers move with it, because the cable lengths are constant)",
        ]
    lines = [f"  can rest, {held}, in the box", f"    {', '.join(sides)}"]
    if (box.centre != robot.home[:3]).any():
        lines[0] += (
            f" that contains ({quantity_row(box.centre)}) m, the sampled position nearest to home at which it can rest"
        )
    steps = quantity_row(box.spacing[box.spacing > 0], digits=2)
    return [*lines, f"    ({quantity(box.samples)} positions sampled, spaced by {steps} m along the axes)"]
