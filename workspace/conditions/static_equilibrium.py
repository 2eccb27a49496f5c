"""Static equilibrium: tensions inside their limits hold the platform at rest; force balance: without the moments."""

from typing import ClassVar, Literal

import numpy as np

from ...models import Robot
from ..condition import TensionCondition
from ..feasibility import feasible, rest_wrench, shortfall, wrench_rows
from ..places import Places


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


class ForceBalance(BalanceAtRest):
    """Tensions inside the limits balance the weight as a force; moments are ignored.

    It is the first of paper C's conditions. Three cables balance all six rows exactly only on a set of measure zero, so
    the paper's step (d) would reject every sample. Its prisms follow from the forces alone.
    """

    forces_only: ClassVar[bool] = True

    kind: Literal["force-balance"] = "force-balance"
