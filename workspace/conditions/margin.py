"""Capacity margin: the additional wrench that the cables can balance in every direction, at rest."""

from typing import ClassVar, Literal

import numpy as np

from ...models import Robot
from ...models.part import Finite, optional
from ...solvers.margin import margins
from ..condition import Condition, Places, check_places
from ..feasibility import rest_wrench, scaled, wrench_matrices, wrench_rows


class Margin(Condition):
    """The capacity margin at rest is at least a value [N], moments divided by `Robot.length`."""

    takes_every_row: ClassVar[bool] = True

    kind: Literal["margin"] = "margin"
    above: Finite = optional("minimum of the margin [N]", 0.0)

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        return self.margins(robot, places) >= self.above

    def shortfall(self, robot: Robot, places: Places) -> np.ndarray:
        """Return the amount by which the margin is below the value, (n,) [N]."""
        return np.maximum(self.above - self.margins(robot, places), 0.0)

    def margins(self, robot: Robot, places: Places) -> np.ndarray:
        """Return signed distances of the wrench at rest from the boundary of the available wrench set, (n,) [N].

        Inside, they are positive and equal to `solvers.capacity_margin`, also for a flat set. Outside, they are
        negative bounds: the distance is at least as large, and equal if a facet is closest.
        """
        check_places(robot, places)
        rows = wrench_rows(robot)
        w = scaled(robot, rest_wrench(robot), rows)
        found = np.empty(len(places))
        for part, A in wrench_matrices(robot, places, rows):
            found[part] = margins(A, w, robot.t_min, robot.t_max)
        return found
