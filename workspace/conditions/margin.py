"""Capacity margin: how much of any further wrench the platform at rest can take."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from ...models import Robot
from ...models.robot import Finite
from ...solvers.available_wrench import facets
from ..balance import matrices, rest_wrench, rows_of
from ..condition import Condition
from ..places import Places

__all__ = ["Margin"]


class Margin(Condition):
    """The capacity margin at rest is at least a value [N], moments divided by `Robot.length`."""

    kind: Literal["margin"] = "margin"
    above: Finite = Field(default=0.0, description="[N]")

    def _holds(self, robot: Robot, places: Places) -> np.ndarray:
        return self.margins(robot, places) >= self.above

    def lacks(self, robot: Robot, places: Places) -> np.ndarray:
        """How much the margin is below the value, (n,) [N]."""
        return np.maximum(self.above - self.margins(robot, places), 0.0)

    def margins(self, robot: Robot, places: Places) -> np.ndarray:
        """Signed distances of the wrench of rest from the boundary of the available wrench set, (n,) [N].

        Inside, positive, they are those of `solvers.capacity_margin`, also with a set that is flat among all wrenches.
        Outside, negative, they are bounds: the distance is at least as large, and as large where a facet is nearest.
        """
        rows = rows_of(robot)
        w = rest_wrench(robot)[rows] * robot.wrench_scale[rows]
        found = np.empty(len(places))
        for part, A in matrices(robot, places, rows):
            found[part] = _margins(A, w, robot.t_min, robot.t_max)
        return found


def _margins(A: np.ndarray, w: np.ndarray, t_min: np.ndarray, t_max: np.ndarray) -> np.ndarray:
    margins = np.full(len(A), -np.inf)
    real = np.isfinite(A).all(axis=(1, 2))
    if not real.all():
        margins[real] = _margins(A[real], w, t_min, t_max)
        return margins
    walls = facets(A, t_min, t_max)
    along = walls.normals @ w
    inside = np.minimum(walls.high - along, along - walls.low).min(axis=1)
    beside = np.linalg.norm((walls.outside @ (w - walls.offset)[..., None])[..., 0], axis=1)
    return np.where(
        beside > 1e-9 * max(float(np.linalg.norm(w)), 1e-9), -np.hypot(beside, np.minimum(inside, 0.0)), inside
    )
