"""Force balance, the first of paper C's conditions: the three rows of force, without the moments.

Three cables balance all six rows exactly only on a set of measure zero, so the paper's step (d) would reject every
sample. Its prisms follow from the forces alone.
"""

from typing import Literal

import numpy as np

from ...models import Robot
from ..condition import TensionCondition
from ..feasibility import feasible, rest_wrench, shortfall, wrench_rows
from ..places import Places


class ForceBalance(TensionCondition):
    """Tensions inside the limits balance the weight as a force; moments are ignored."""

    kind: Literal["force-balance"] = "force-balance"

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        rows = wrench_rows(robot, forces_only=True)
        return feasible(robot, places, rest_wrench(robot)[None], rows, self.robust)

    def shortfall(self, robot: Robot, places: Places) -> np.ndarray:
        """Return the distance from the required force to the available ones, (n,) [N]."""
        rows = wrench_rows(robot, forces_only=True)
        return shortfall(robot, places, rest_wrench(robot)[None], rows, self.robust)
