"""Wrench with a tolerance, the second of paper C's conditions: the weight is balanced but for a stated rest."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from ...models import Robot
from ...models.robot import NonNegative
from ...solvers import solve_batch
from ..balance import matrices, rest_wrench, rows_of
from ..condition import Condition
from ..places import Places

__all__ = ["WrenchWithTolerance"]

_RHO = 1e10  # weight of the wrench error beside the tensions: so large that these do not shift it


class WrenchWithTolerance(Condition):
    """Tensions inside the limits balance the weight within a tolerance of |(force, moment / length)| [N].

    `length` is `Robot.length`, the largest distance of an attachment from the CoM.
    """

    kind: Literal["wrench-with-tolerance"] = "wrench-with-tolerance"
    tolerance: NonNegative = Field(description="largest wrench error, moments divided by the robot's length [N]")

    def _holds(self, robot: Robot, places: Places) -> np.ndarray:
        return self.error(robot, places) <= self.tolerance

    def lacks(self, robot: Robot, places: Places) -> np.ndarray:
        """How much more than the tolerance the error is, (n,) [N]."""
        return np.maximum(self.error(robot, places) - self.tolerance, 0.0)

    def error(self, robot: Robot, places: Places) -> np.ndarray:
        """Smallest wrench error that tensions inside the limits leave, (n,) [N]; infinite where a cable has none."""
        rows = rows_of(robot)
        w = rest_wrench(robot)[rows] * robot.wrench_scale[rows]
        error = np.empty(len(places))
        for part, A in matrices(robot, places, rows):
            error[part] = solve_batch(A, w, robot.t_min, robot.t_max, rho=_RHO, threads=1).residual
        return np.nan_to_num(error, nan=np.inf)
