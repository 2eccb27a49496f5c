"""Wrench with a tolerance, the second of paper C's conditions: the weight is balanced up to a tolerance."""

from typing import Literal

import numpy as np
from pydantic import Field

from ...models import Robot
from ...models.part import NonNegative
from ...solvers import solve_batch
from ..condition import Condition, Places, check_places
from ..feasibility import NEAREST, rest_wrench, scaled, wrench_matrices, wrench_rows


class WrenchWithTolerance(Condition):
    """Tensions inside the limits balance the weight up to a tolerance of |(force, moment / length)| [N].

    `length` is `Robot.length`, the largest distance from the CoM to an attachment.
    """

    kind: Literal["wrench-with-tolerance"] = "wrench-with-tolerance"
    tolerance: NonNegative = Field(description="largest wrench error, moments divided by the robot's length [N]")

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        return self.error(robot, places) <= self.tolerance

    def shortfall(self, robot: Robot, places: Places) -> np.ndarray:
        """Return the amount by which the error exceeds the tolerance, (n,) [N]."""
        return np.maximum(self.error(robot, places) - self.tolerance, 0.0)

    def error(self, robot: Robot, places: Places) -> np.ndarray:
        """Return the smallest wrench error of tensions inside the limits, (n,) [N]: 0 where the platform can rest.

        It is infinite where a cable has no length.
        """
        check_places(robot, places)
        rows = wrench_rows(robot)
        w = scaled(robot, rest_wrench(robot), rows)
        error, limits = np.zeros(len(places)), (robot.t_min, robot.t_max)
        for part, A in wrench_matrices(robot, places, rows):
            short = np.flatnonzero(~solve_batch(A, w, *limits, threads=1).feasible)
            error[part.start + short] = solve_batch(A[short], w, *limits, rho=NEAREST, threads=1).residual
        return np.nan_to_num(error, nan=np.inf)
