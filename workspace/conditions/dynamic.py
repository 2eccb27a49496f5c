"""Dynamic: from rest, the cables can give the platform every acceleration of a set."""

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...models import Robot
from ...models.dynamics import dynamics_of
from ...models.part import Finite, Rows
from ..condition import Places, TensionCondition
from ..feasibility import feasible


class Dynamic(TensionCondition):
    """Tensions inside the limits can give the platform, which is at rest, every acceleration of a list.

    At a given pose the required wrench is linear in the acceleration, so the tensions can give every acceleration in
    the convex hull of the list too.
    """

    takes_every_row: ClassVar[bool] = True

    kind: Literal["dynamic"] = "dynamic"
    accelerations: Rows[tuple[Finite, Finite, Finite, Finite, Finite, Finite]] = Field(
        description="second derivatives of (x, y, z, roll, pitch, yaw) [m/s^2, rad/s^2]"
    )

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        accelerations = np.array(self.accelerations) * robot.dof_mask
        wrenches = dynamics_of(robot).required_wrench(places.pose, np.zeros(6), accelerations[:, None])
        return feasible(robot, places, wrenches, robust=self.robust)
