"""Wrench feasible: the cables hold the platform at rest against every wrench of a set, in addition to its weight.

The wrenches that the cables can give are a convex set. So they can balance every wrench of a polytope if and only if
they can balance each of its vertices.
"""

from itertools import product
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from ...models import Robot
from ...models.part import Finite, Rows, optional
from ..condition import Places, TensionCondition
from ..feasibility import feasible, rest_wrench, shortfall

Wrench = tuple[Finite, Finite, Finite, Finite, Finite, Finite]


class WrenchFeasible(TensionCondition):
    """Tensions inside the limits balance the weight and every wrench of a box or of a polytope."""

    takes_every_row: ClassVar[bool] = True

    kind: Literal["wrench-feasible"] = "wrench-feasible"
    box: tuple[Wrench, Wrench] | None = optional(
        "minimum and maximum of (fx, fy, fz, mx, my, mz) on the platform, about the CoM [N, N m]"
    )
    vertices: Rows[Wrench] | None = optional("corners of a polytope of such wrenches [N, N m]")

    @model_validator(mode="after")
    def _one_set(self) -> Self:
        if (self.box is None) == (self.vertices is None):
            got = "neither" if self.box is None else "both"
            raise ValueError(f"box or vertices must be given, and not both, got {got}")
        if self.box is not None:
            for name, low, high in zip(("fx", "fy", "fz", "mx", "my", "mz"), *self.box, strict=True):
                if low > high:
                    raise ValueError(
                        f"box must have minima that do not exceed its maxima, {high:g} for {name}, got {low:g}"
                    )
        return self

    def corners(self) -> np.ndarray:
        """Return the vertices of the set, (k, 6) [N, N m]."""
        if self.vertices is not None:
            return np.array(self.vertices)
        assert self.box is not None
        return np.array(list(product(*[sorted({low, high}) for low, high in zip(*self.box, strict=True)])))

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        return feasible(robot, places, self._wrenches(robot), robust=self.robust)

    def shortfall(self, robot: Robot, places: Places) -> np.ndarray:
        """Return the largest distance of a required wrench from the available ones, moments over length, (n,) [N]."""
        return shortfall(robot, places, self._wrenches(robot), robust=self.robust)

    def _wrenches(self, robot: Robot) -> np.ndarray:
        weight = rest_wrench(robot)
        # A guide takes the wrench along a coordinate that cannot move.
        return weight - np.unique(self.corners() * robot.dof_mask, axis=0)
