"""References for each period of a controller, from a plan or a trajectory; `stop`, the fastest stop along a plan."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import lru_cache
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from ..base.inputs import InputError, number, shown
from ..models.dynamics import dynamics_of
from ..models.parsing import parse_yaml
from ..models.rigid_load import RigidLoad
from ..models.robot import Robot
from ..models.trajectory import Motion, Trajectory
from ..solvers import solve_batch
from ..solvers.in_place import RHO
from ..statics.stop_result import Stop
from ..statics.stops import beginnings, longest_stop_along, stop_along
from .controller import Reference
from .trajectory import HasTrajectory, read_trajectory, samples_of

if TYPE_CHECKING:
    import xarray as xr

MOST = 1e6  # periods
LONGEST = 10_000  # instants


def references(
    plan: HasTrajectory | xr.Dataset | str | os.PathLike[str], period: float, start: float = 0.0
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


def planned(plan: HasTrajectory | xr.Dataset | str | os.PathLike[str]) -> tuple[Robot, Trajectory]:
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


def stop(plan: HasTrajectory | xr.Dataset | str | os.PathLike[str], time: float) -> Stop:
    """Stop on the path of a plan as soon as tensions inside their limits permit.

    Platform and carriers stay on their path, each at the same fraction of the plan's velocity at any time, and never
    become faster than planned. Accelerations and tensions are continuous. If no stop inside the limits was found, the
    result is the stop with the smallest missing wrench, with its certificate. The time to compute it depends on how
    long the robot takes to stop, not on the plan.

    Carriers that fly, each with one cable, leave their path: each moves so that its cable has the direction of the
    required force, which changes as little as possible (`statics.team_stops`). If all cables together give every
    wrench, flying carriers stay on their paths and tilt. Cables of fixed length must then begin at one point of each
    carrier, and this point stays on its path. Winches compensate tilts by the lengths of their cables.

    Args:
        plan: A `Plan`, another object with such a `trajectory`, such a dataset, or the NetCDF file of one.
        time: Time in the plan at which the stop begins [s]; a time after the plan's end means the end. A periodic plan,
            which ends in the state in which it begins, is repeated. Another that ends while the robot moves is
            continued with its last velocity. Its last acceleration and rotation, and the motion of a team's carriers
            relative to the platform, fade within a second.

    Returns:
        Stop: `simulate` and `references` take it as they take a plan.

    Raises:
        InputError: If an argument has a wrong type or value, or the robot has flying carriers with other cables.
    """
    robot, trajectory = planned(plan)
    return stop_along(robot, trajectory, number("time", time, 0.0, 1e9))


def longest_stop(plan: HasTrajectory | xr.Dataset | str | os.PathLike[str], period: float = 0.02) -> Stop:
    """Return the longest of the stops that begin at regular instants of a plan, or the first one that is infeasible.

    If it is feasible, the robot can stop within its duration from each of these instants. Computing a stop takes a
    few milliseconds.

    Args:
        plan: A `Plan`, another object with such a `trajectory`, such a dataset, or the NetCDF file of one.
        period: Time between two instants [s].

    Raises:
        InputError: As `stop` does, or if there are more than 10 000 instants.
    """
    robot, trajectory = planned(plan)
    period = number("period", period, 1e-6, 1e9)
    if (trajectory.duration or 0.0) > LONGEST * period:
        raise InputError(f"period must be so long that there are at most {LONGEST} periods, got {period:g} s")
    return longest_stop_along(robot, trajectory, beginnings(trajectory, period))
