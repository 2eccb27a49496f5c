"""Wrench closure: cables whose tensions have no upper limit can give every wrench.

That holds if and only if the columns of A span all wrench rows and some positive tensions balance each other: A t = 0,
t > 0. The tensions can be scaled, so t >= 1 is the same condition.
"""

from typing import Literal

import numpy as np

from ...models import Robot
from ...solvers import solve_batch
from ...solvers.available_wrench import spans
from ..condition import Condition, Places
from ..feasibility import wrench_matrices, wrench_rows


class WrenchClosure(Condition):
    """The cables can give every wrench by pulling, if they are strong enough; the tension limits are ignored."""

    kind: Literal["wrench-closure"] = "wrench-closure"

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        rows = wrench_rows(robot)
        held = np.zeros(len(places), dtype=bool)
        if robot.m <= rows.size:
            return held
        for part, A in wrench_matrices(robot, places, rows):
            closed = solve_batch(A, np.zeros(rows.size), 1.0, np.inf, threads=1).feasible
            closed[closed] = spans(A[closed])
            held[part] = closed
        return held

    def why_nowhere(self, robot: Robot) -> str | None:
        """Return a sentence if the robot has no more cables than degrees of freedom."""
        count = wrench_rows(robot).size
        if robot.m > count:
            return None
        return f"wrench closure of {count} degrees of freedom needs {count + 1} cables or more; the robot has {robot.m}"
