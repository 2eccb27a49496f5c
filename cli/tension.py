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
        beside = {name: other.to_dict() for name, other in {method: answer, **others}.items()}
        print_json({"robot": loaded.name, **at, **answer.to_dict(), "methods": beside})
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

    from ..distribution import pose_problem
    from ..models import Dynamics

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
    from rich.measure import Measurement
    from rich.table import Table

    # One row a method: there are more of them than cables.
    table = Table(box=None, pad_edge=False)
    table.add_column("tensions [N]", no_wrap=True)
    for heading in (*(str(i + 1) for i in range(robot.m)), "status", "ms"):
        table.add_column(heading)
    table.add_row("t_min", *(f"{limit:g}" for limit in robot.t_min), "", "")
    for name, found in methods.items():
        tensions = ["-"] * robot.m if found.tensions is None else [f"{t:.3f}" for t in found.tensions]
        table.add_row(name, *tensions, found.status.value, f"{1e3 * found.time:.2f}")
    table.add_row("t_max", *(f"{limit:g}" for limit in robot.t_max), "", "")
    pose = ", ".join(f"{value:g}" for value in at["pose"])
    typer.echo(f"{robot.name} at ({pose}): {answer.status.value.upper()}")
    console = Console()
    # A number cut to fit a narrow terminal would be another number: rather let lines wrap.
    whole = Measurement.get(console, console.options.update(max_width=1000), table).maximum
    Console(width=max(console.width, whole)).print(table)
    if answer.tensions is not None:
        typer.echo(f"residual {answer.residual:.2e} N")
    if answer.certificate is not None:
        typer.echo(answer.certificate.describe())
    if answer.detail:
        typer.echo(answer.detail)
