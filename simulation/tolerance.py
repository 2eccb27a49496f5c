"""The position error with which a run passes."""

import numpy as np

from ..base.inputs import number
from ..control.deviation import FAR, MOST
from ..models import Robot
from ..models.dynamics import dynamics_of


def tolerance_of(robot: Robot, given: float | None) -> float:
    """Return the given tolerance [m], or by default 50 mm, of small robots 5 % of the mean cable length at home.

    Raises `InputError` if the given one is not a number from 0 to 1e6.
    """
    if given is not None:
        return number("tolerance", given, 0.0, 1e6)
    return min(MOST, FAR * float(np.mean(dynamics_of(robot).cable_lengths(robot.home))))
