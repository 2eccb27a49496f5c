"""Dynamic: from rest, the platform can be given every acceleration of a set."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from ...models import Robot
from ...models.dynamics import dynamics_of
from ...models.robot import Finite
from ..balance import can_give
from ..condition import Condition
from ..places import Places

__all__ = ["Dynamic"]


class Dynamic(Condition):
    """Tensions inside the limits give each of some accelerations to a platform at rest.

    What they need is linear in the acceleration at a given pose, so every acceleration of their convex hull can be
    given too.
    """

    kind: Literal["dynamic"] = "dynamic"
    accelerations: tuple[tuple[Finite, Finite, Finite, Finite, Finite, Finite], ...] = Field(
        min_length=1, description="second derivatives of (x, y, z, roll, pitch, yaw) [m/s^2, rad/s^2]"
    )

    def _holds(self, robot: Robot, places: Places) -> np.ndarray:
        accelerations = np.array(self.accelerations) * robot.dof_mask
        wrenches = dynamics_of(robot).required_wrench(places.pose, np.zeros(6), accelerations[:, None])
        return can_give(robot, places, wrenches)
