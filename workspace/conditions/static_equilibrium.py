"""Static equilibrium: tensions inside their limits hold the platform at rest."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...models import Robot
from ..balance import can_give, lacking, rest_wrench
from ..condition import Condition
from ..places import Places

__all__ = ["StaticEquilibrium"]


class StaticEquilibrium(Condition):
    """Tensions inside the limits balance the platform's weight."""

    kind: Literal["static-equilibrium"] = "static-equilibrium"

    def _holds(self, robot: Robot, places: Places) -> np.ndarray:
        return can_give(robot, places, rest_wrench(robot)[None])

    def lacks(self, robot: Robot, places: Places) -> np.ndarray:
        """How far the weight is from what the cables can give, moments divided by `Robot.length`, (n,) [N]."""
        return lacking(robot, places, rest_wrench(robot)[None])
