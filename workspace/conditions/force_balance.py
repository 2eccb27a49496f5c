"""Force balance, the first of paper C's conditions: the three rows of force, whatever the moments are.

With three cables an exact balance of all six rows exists only on a thin set of postures, so the paper's step (d) would
reject every sample. Its prisms are those of the forces alone.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...models import Robot
from ..balance import can_give, lacking, rest_wrench, rows_of
from ..condition import Condition
from ..places import Places

__all__ = ["ForceBalance"]


class ForceBalance(Condition):
    """Tensions inside the limits balance the weight as a force; moments do not count."""

    kind: Literal["force-balance"] = "force-balance"

    def _holds(self, robot: Robot, places: Places) -> np.ndarray:
        rows = rows_of(robot, forces_only=True)
        return can_give(robot, places, rest_wrench(robot)[None], rows)

    def lacks(self, robot: Robot, places: Places) -> np.ndarray:
        """How far the weight is from what the cables can give, (n,) [N]."""
        return lacking(robot, places, rest_wrench(robot)[None], rows_of(robot, forces_only=True))
