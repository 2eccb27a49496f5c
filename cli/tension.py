"""`towline tension`: the tensions at one instant, by every method."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import typer

from .options import CarrierPoseOption, JsonOption, RobotArgument, numbers, parameters, print_json, print_table

if TYPE_CHECKING:
    import numpy as np

    from ..models import Robot
    from ..solvers import TensionProblem, TensionSolution

# Those of `solvers.methods`, which takes longer to load than help may.
METHODS = (
    "active-set, daqp, qp, min-norm, closed-form, improved-closed-form, centroid, 1-norm, 2-norm, dykstra, least-sum, "
    "largest-margin, min-max, log-barrier, analytic-centre, p-norm, soft-wrench"
)


@parameters(f"""
    --pose 'x y z roll pitch yaw': Pose of the platform in the frame {{G}} [m, rad]; default: its home.
    --velocity 'six numbers': Time derivative of the pose [m/s, rad/s]; default: zero.
    --acceleration 'six numbers': Second time derivative of the pose [m/s^2, rad/s^2]; default: zero.
    --wind 'x y z': Velocity of the air in {{G}} [m/s]; default: no aerodynamic forces. '0 0 0' is still air, with drag
        on a moving platform.
    --method NAME: Method that determines the exit code: {METHODS}.
    --backend NAME: QP solver that the method qp uses.
""")
def tension(
    robot: RobotArgument,
    pose: str | None = None,
    velocity: str | None = None,
    acceleration: str | None = None,
    carrier_pose: CarrierPoseOption = None,
    wind: str | None = None,
    method: str = "active-set",
    backend: str | None = None,
    as_json: JsonOption = False,
) -> None:
    """Compute the cable tensions for one pose and motion by every method.

    The exit code is 1 if the method chosen with --method returns no tensions inside the limits. If none exist, the
    proof is printed.
    """
    from ..models import Dynamics, load
    from ..solvers import methods
    from ..statics.distribution import pose_problem

    loaded = load(robot)
    place = loaded.home if pose is None else numbers("--pose", pose, 6)
    rate = None if velocity is None else numbers("--velocity", velocity, 6)
    rate_rate = None if acceleration is None else numbers("--acceleration", acceleration, 6)
    carriers = None if carrier_pose is None else numbers("--carrier-pose", carrier_pose, 6, rows=len(loaded.carriers))
    air = None if wind is None else numbers("--wind", wind, 3)
    problem = pose_problem(Dynamics(loaded), place, rate, rate_rate, carriers, wind=air)
    at = {"pose": place.tolist(), "wrench": problem.w.tolist()}
    # Report a wrong method or back end before the others compute.
    solution = _solve(problem, method, backend)
    solutions = {method: solution, **{name: _solve(problem, name) for name in methods() if name != method}}
    if as_json:
        each = {name: other.to_dict() for name, other in solutions.items()}
        print_json({"robot": loaded.name, **at, **solution.to_dict(), "methods": each})
    else:
        _show(loaded, at, solutions, method)
        _show_slipped_units(loaded, place, air)
    if not solution.feasible:
        raise typer.Exit(1)


def _show_slipped_units(robot: Robot, pose: np.ndarray, wind: np.ndarray | None) -> None:
    """Print a line for each unit in which numbers of the pose, the wind or the robot seem to be instead."""
    from ..ocp.tasks.task import Task
    from ..ocp.warnings.values import slipped_units

    task = {"path": {"kind": "rest", "pose": pose.tolist()}, "wind": None if wind is None else wind.tolist()}
    for sentence in slipped_units(robot, Task.model_validate(task)):
        typer.echo(re.sub(r"\b(path\.pose|wind)(?=[,:])", lambda key: f"--{key[0].removeprefix('path.')}", sentence))


def _solve(problem: TensionProblem, method: str, backend: str | None = None) -> TensionSolution:
    """Solve twice, because the first call also loads libraries, and time the second call."""
    from ..solvers import solve

    solve(problem, method=method, backend=backend)
    return solve(problem, method=method, backend=backend)


def _show(robot: Robot, at: dict[str, Any], solutions: dict[str, TensionSolution], method: str) -> None:
    from ..base.text import column, quantity, quantity_row

    solution = solutions[method]
    # One row for each method: there are more of them than cables.
    names = ["t_min", *solutions, "t_max"]
    tensions = [
        robot.t_min,
        *(robot.m * [None] if each.tensions is None else each.tensions for each in solutions.values()),
        robot.t_max,
    ]
    cables = [column([row[i] for row in tensions], digits=5) for i in range(robot.m)]
    status = ["", *(each.status.value for each in solutions.values()), ""]
    times = ["", *(f"{1e6 * each.time:.1f} us" for each in solutions.values()), ""]
    typer.echo(f"{robot.name} at ({quantity_row(at['pose'])}) [m, rad]: {solution.status.value.upper()}")
    print_table(
        ["tensions [N] of cable", *(str(i + 1) for i in range(robot.m)), "status", "time"],
        list(zip(names, *cables, status, times, strict=True)),
        f"l{robot.m * 'r'}lr",
    )
    if solution.tensions is not None:
        typer.echo(f"residual of the wrench {quantity(solution.residual, 'N', digits=2)}")
    if solution.certificate is not None:
        typer.echo(solution.certificate.describe())
    if solution.detail:
        typer.echo(solution.detail)
