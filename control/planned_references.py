"""References for each period of a controller: `references` from a plan, `references_at` from a trajectory."""

import os
from collections.abc import Sequence
from functools import lru_cache
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import InputError
from ..base.inputs import number, shown
from ..models.dynamics import dynamics_of
from ..models.parsing import parse_yaml
from ..models.rigid_load import RigidLoad
from ..models.robot import Robot
from ..models.trajectory import Motion, Trajectory
from ..solvers import solve_batch
from ..solvers.in_place import RHO
from .state import Reference
from .trajectory import HasTrajectory, read_trajectory, samples_of

if TYPE_CHECKING:
    import xarray as xr

MOST = 1e6  # periods


def references(
    plan: "HasTrajectory | xr.Dataset | str | os.PathLike[str]", period: float, start: float = 0.0
) -> list[Reference]:
    """Return the reference of each period of a plan, as `Predictive.follow` and a control loop take them.

    Reference k is the plan at the time start + k period. The last one is the first at or after the plan's end.

    Args:
        plan: A `Plan`, a `Stop`, another object with a `trajectory`, such a dataset, or the NetCDF file of one.
        period: Period of the controller [s].
        start: Time in the plan at which the references begin [s].

    Raises:
        InputError: If an argument has a wrong type or value, or there are more than a million periods.
    """
    robot, trajectory = planned(plan)
    assert trajectory.duration is not None  # of samples
    period, start = number("period", period, 1e-6, 1e3), number("start", start, 0.0, 1e9)
    count = max(0.0, np.ceil((trajectory.duration - start) / period - 1e-9))
    if count > MOST:
        raise InputError(f"period must be so long that there are at most {MOST:g} periods, got {period:g} s")
    return references_at(robot, trajectory, start + period * np.arange(int(count) + 1))


def planned(plan: "HasTrajectory | xr.Dataset | str | os.PathLike[str]") -> tuple[Robot, Trajectory]:
    """Return the robot of a plan, and its trajectory. Raises `InputError` if it is not a plan."""
    samples = samples_of("plan", plan)
    if samples is None or "robot" not in samples.attributes:
        raise InputError(f"plan must be a plan, its dataset or its NetCDF file, got {shown(plan)}")
    robot = None if hasattr(plan, "data_vars") else getattr(getattr(plan, "scenario", plan), "robot", None)
    robot = robot if isinstance(robot, Robot) else _robot(str(samples.attributes["robot"]))
    return robot, read_trajectory(robot, samples, None)


@lru_cache(maxsize=4)
def _robot(text: str) -> Robot:
    """Return the robot of a file's text, which takes longer to read than a stop to compute."""
    return parse_yaml(text, Robot, "plan")


def references_at(robot: Robot, trajectory: Trajectory, times: np.ndarray) -> list[Reference]:
    """Return a reference for each of the times (n,) [s]."""
    platform, carriers = trajectory.at(times)
    loads = [trajectory.load_at(time) for time in times.tolist()] if trajectory.loads else [None] * len(times)
    tensions = trajectory.tensions(times) if trajectory.tensions else _tensions_along(robot, platform, carriers, loads)
    rows = zip(*platform, *carriers, tensions, loads, strict=True)
    return [Reference(*row) for row in rows]


def _tensions_along(robot: Robot, platform: Motion, carriers: Motion, loads: Sequence[RigidLoad | None]) -> np.ndarray:
    """Return the smallest tensions for a reference, (n, m) [N]; where none exist, those with the closest wrench."""
    mask, count = robot.dof_mask, len(platform[0])
    A, w = np.empty((count, 6, robot.m)), np.empty((count, 6))
    for load, run in groupby(range(count), loads.__getitem__):
        rows, dynamics = list(run), dynamics_of(robot if load is None else load.on(robot))
        moving, bases = [part[rows] for part in platform], [part[rows] for part in carriers]
        A[rows] = dynamics.wrench_matrix(moving[0], bases[0]) * mask[:, None]
        w[rows] = dynamics.required_wrench(*moving, *bases) * mask
    return solve_batch(A, w, robot.t_min, robot.t_max, length=robot.length, rho=RHO).tensions
