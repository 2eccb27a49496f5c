"""Stop a robot on the path of its plan: `stop`, and from where that takes longest: `longest_stop`."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from ..base.errors import InputError
from ..base.inputs import number
from ..statics.stop_result import Stop
from ..statics.stops import beginnings, longest_stop_along, stop_along
from .planned_references import planned
from .trajectory import HasTrajectory

if TYPE_CHECKING:
    import xarray as xr

MOST = 10_000  # instants


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
        time: Time in the plan at which the stop begins [s]; a time after the plan's end means the end. A plan that ends
            while the robot moves is continued with its last velocity. Its last acceleration and rotation, and the
            motion of a team's carriers relative to the platform, fade within a second.

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
    if (trajectory.duration or 0.0) > MOST * period:
        raise InputError(f"period must be so long that there are at most {MOST} periods, got {period:g} s")
    return longest_stop_along(robot, trajectory, beginnings(trajectory, period))
