"""`dimensions`: the coordinates of a robot's datasets over time, the same in plans and simulations."""

import numpy as np

from ..base.netcdf import Variable
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
