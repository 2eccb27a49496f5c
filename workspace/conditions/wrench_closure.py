"""Wrench closure: cables whose tensions have no upper limit can give any wrench whatever.

That is so if and only if the columns of A span all wrench rows and some tensions, all positive, balance each other:
A t = 0, t > 0. The tensions can be scaled, so t >= 1 asks the same.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...models import Robot
from ...solvers import solve_batch
from ...solvers.available_wrench import spans
from ..balance import matrices, rows_of
from ..condition import Condition
from ..places import Places

__all__ = ["WrenchClosure"]


class WrenchClosure(Condition):
    """Any wrench can be given by pulling, if the cables are strong enough; the tension limits do not count."""

    kind: Literal["wrench-closure"] = "wrench-closure"

    def _holds(self, robot: Robot, places: Places) -> np.ndarray:
        rows = rows_of(robot)
        held = np.zeros(len(places), dtype=bool)
        if robot.m <= rows.size:
            return held
        for part, A in matrices(robot, places, rows):
            closed = solve_batch(A, np.zeros(rows.size), 1.0, np.inf, threads=1).feasible
            closed[closed] = spans(A[closed])
            held[part] = closed
        return held
