"""Static equilibrium: tensions inside their limits hold the platform at rest."""

from typing import ClassVar, Literal

import numpy as np

from ...models import Robot
from ..condition import Places, TensionCondition
from ..feasibility import feasible, rest_wrench, shortfall, wrench_rows


class BalanceAtRest(TensionCondition):
    """Tensions inside the limits balance the weight, or its force alone."""

    forces_only: ClassVar[bool] = False

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        return feasible(robot, places, rest_wrench(robot)[None], wrench_rows(robot, self.forces_only), self.robust)

    def shortfall(self, robot: Robot, places: Places) -> np.ndarray:
        """Return the distance from the required wrench to the available ones, moments over length, (n,) [N]."""
        return shortfall(robot, places, rest_wrench(robot)[None], wrench_rows(robot, self.forces_only), self.robust)


class StaticEquilibrium(BalanceAtRest):
    """Tensions inside the limits balance the platform's weight."""

    takes_every_row: ClassVar[bool] = True

    kind: Literal["static-equilibrium"] = "static-equilibrium"
