"""Wrench feasible: the platform holds still against every wrench of a set that acts on it beside its weight.

The wrenches that the cables can give are a convex set. So every wrench of a polytope can be balanced if and only if
each of its vertices can.
"""

from __future__ import annotations

from itertools import product
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ...models import Robot
from ...models.robot import Finite
from ..balance import can_give, lacking, rest_wrench
from ..condition import Condition
from ..places import Places

__all__ = ["WrenchFeasible"]

Wrench = tuple[Finite, Finite, Finite, Finite, Finite, Finite]


class WrenchFeasible(Condition):
    """Tensions inside the limits balance the weight and every wrench of a box or of a polytope."""

    kind: Literal["wrench-feasible"] = "wrench-feasible"
    box: tuple[Wrench, Wrench] | None = Field(
        default=None, description="least and most of (fx, fy, fz, mx, my, mz) on the platform, about the CoM [N, N m]"
    )
    vertices: tuple[Wrench, ...] | None = Field(
        default=None, min_length=1, description="corners of a polytope of such wrenches [N, N m]"
    )

    @model_validator(mode="after")
    def _one_set(self) -> Self:
        if (self.box is None) == (self.vertices is None):
            raise ValueError("accepted: box or vertices, one of them")
        if self.box is not None:
            for name, low, high in zip(("fx", "fy", "fz", "mx", "my", "mz"), *self.box, strict=True):
                if low > high:
                    raise ValueError(f"box: the least must not exceed the most, but of {name} they are {low}, {high}")
        return self

    def corners(self) -> np.ndarray:
        """Wrenches on the platform that decide, (k, 6) [N, N m]."""
        if self.vertices is not None:
            return np.array(self.vertices)
        assert self.box is not None
        return np.array(list(product(*[sorted({low, high}) for low, high in zip(*self.box, strict=True)])))

    def _holds(self, robot: Robot, places: Places) -> np.ndarray:
        return can_give(robot, places, self._wrenches(robot))

    def lacks(self, robot: Robot, places: Places) -> np.ndarray:
        """How far the farthest is from what the cables can give, moments divided by `Robot.length`, (n,) [N]."""
        return lacking(robot, places, self._wrenches(robot))

    def _wrenches(self, robot: Robot) -> np.ndarray:
        # What a coordinate that cannot move is pushed by, its guide takes.
        corners = np.unique(self.corners() * robot.dof_mask, axis=0)
        return rest_wrench(robot) - corners
