"""`towline tension`: one tension distribution, by every method."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options import JsonOption, RobotArgument, numbers, print_json

if TYPE_CHECKING:
    from ..models import Robot
    from ..solvers import TensionProblem, TensionSolution

SIX = "x y z roll pitch yaw"


def tension(
    robot: RobotArgument,
    pose: Annotated[str | None, typer.Option(help=f"Platform in {{G}}: '{SIX}' [m, rad]; none: home.")] = None,
    velocity: Annotated[str | None, typer.Option(help="Its time derivative, six numbers; none: at rest.")] = None,
    acceleration: Annotated[str | None, typer.Option(help="Its second derivative, six numbers; none: zero.")] = None,
    carrier_pose: Annotated[
        str | None, typer.Option(help=f"'{SIX}' of each carrier in {{G}}, apart by ';'; none: at home.")
    ] = None,
    wind: Annotated[str | None, typer.Option(help="Air velocity in {G}: 'x y z' [m/s]; none: no air.")] = None,
    method: Annotated[
        str, typer.Option(help="The method whose answer counts; the others stand beside it.")
    ] = "active-set",
    backend: Annotated[str | None, typer.Option(help="QP solver for the method qp.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Distribute the tensions at one pose and motion, or prove that none exist (exit code 1)."""
    from ..models import load
    from ..solvers import methods, solve

    loaded = load(robot)
    problem, at = _problem(loaded, pose, velocity, acceleration, carrier_pose, wind)
    answer = solve(problem, method=method, backend=backend)
    others = {name: solve(problem, method=name) for name in methods() if name != method}
    if as_json:
        beside = {name: other.as_dict() for name, other in {method: answer, **others}.items()}
        print_json({"robot": loaded.name, **at, **answer.as_dict(), "methods": beside})
    else:
        _show(loaded, at, answer, {method: answer, **others})
    if not answer.feasible:
        raise typer.Exit(1)


def _problem(
    robot: Robot,
    pose: str | None,
    velocity: str | None,
    acceleration: str | None,
    carrier_pose: str | None,
    wind: str | None,
) -> tuple[TensionProblem, dict[str, Any]]:
    """The problem at the stated pose and motion, and those as lists."""
    import numpy as np

    from ..models import Dynamics
    from ..workspace import pose_problem

    at = robot.home if pose is None else numbers("--pose", pose, 6)
    rate = np.zeros(6) if velocity is None else numbers("--velocity", velocity, 6)
    rate_rate = np.zeros(6) if acceleration is None else numbers("--acceleration", acceleration, 6)
    count = len(robot.carriers)
    carriers = robot.carrier_home if carrier_pose is None else numbers("--carrier-pose", carrier_pose, 6, rows=count)
    air = None if wind is None else numbers("--wind", wind, 3)
    problem = pose_problem(Dynamics(robot), at, rate, rate_rate, carriers, air)
    return problem, {"pose": at.tolist(), "wrench": problem.w.tolist()}


def _show(robot: Robot, at: dict[str, Any], answer: TensionSolution, methods: dict[str, TensionSolution]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("cable", "t_min [N]", *(f"{name} [N]" for name in methods), "t_max [N]", box=None, pad_edge=False)
    for i in range(robot.m):
        found = [f"{m.tensions[i]:.4f}" if m.tensions is not None else "-" for m in methods.values()]
        table.add_row(str(i + 1), f"{robot.t_min[i]:g}", *found, f"{robot.t_max[i]:g}")
    table.add_row("status", "", *(m.status.value for m in methods.values()), "")
    table.add_row("time [ms]", "", *(f"{1e3 * m.time:.2f}" for m in methods.values()), "")
    pose = ", ".join(f"{value:g}" for value in at["pose"])
    typer.echo(f"{robot.name} at ({pose}): {answer.status.value.upper()}")
    Console().print(table)
    if answer.tensions is not None:
        typer.echo(f"residual {answer.residual:.2e} N")
    if answer.certificate is not None:
        typer.echo(answer.certificate.in_words())
    if answer.detail:
        typer.echo(answer.detail)
