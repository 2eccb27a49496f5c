"""What datasets of plans, stops and simulations share: `dimensions` of a robot over time, and `motion_variables`."""

from collections.abc import Iterable

import numpy as np

from ..base.netcdf import UNITS, Variable
from .part import COORDINATES
from .robot import Robot


def dimensions(robot: Robot, times: np.ndarray) -> dict[str, Variable]:
    """Return time (n,) [s], coordinate, carrier with its kind and whether it moves, and cable, from 1."""
    carriers = robot.carriers
    return {
        "time": Variable(("time",), times, {"units": "s"}),
        "coordinate": Variable(("coordinate",), np.array(COORDINATES)),
        "carrier": Variable(("carrier",), np.array([carrier.name for carrier in carriers])),
        "carrier_kind": Variable(("carrier",), np.array([carrier.kind for carrier in carriers])),
        "carrier_moves": Variable(("carrier",), np.array([carrier.moves for carrier in carriers])),
        "cable": Variable(("cable",), np.arange(1, robot.m + 1)),
    }


def over(dims: tuple[str, ...], values: np.ndarray, unit: str, about: str) -> Variable:
    """Return a variable with its unit and what it is."""
    return Variable(dims, values, {"units": unit, "long_name": about})


def motion_variables(platform: Iterable[np.ndarray], carriers: Iterable[np.ndarray]) -> dict[str, Variable]:
    """Return pose, velocity and acceleration over time, of the platform, (n, 6) each, and carriers, (n, c, 6) each."""
    variables = {}
    for name, part, its in zip(("pose", "velocity", "acceleration"), platform, carriers, strict=True):
        variables[name] = over(("time", "coordinate"), part, UNITS[name], f"{name} of the platform frame in G")
        about = f"{name} of each carrier in G"
        variables[f"carrier_{name}"] = over(("time", "carrier", "coordinate"), its, UNITS[name], about)
    return variables
