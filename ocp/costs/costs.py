"""`Costs`: all costs of a task for one robot, and the function that evaluates them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ...base.display import Displayed
from ...models import Robot
from ...models.batch import BLOCK, in_blocks
from ..limits.limits import Motion, motions, of_motions
from ..limits.state import Body
from .cost import Cost, CostState, RateCost
from .terms import Jerk


@dataclass(frozen=True, eq=False)
class Costs(Displayed):
    """The costs of a task."""

    robot: Robot
    all: tuple[Cost, ...]

    def __reduce__(self) -> tuple[type[Costs], tuple[Robot, tuple[Cost, ...]]]:
        """Pickle what was given: the function is built again."""
        return Costs, (self.robot, self.all)

    @property
    def jerk(self) -> float:
        """Return the jerk that adds one; infinite if it costs nothing."""
        return min((cost.amount for cost in self.all if isinstance(cost, Jerk)), default=np.inf)

    @property
    def has_rates(self) -> bool:
        """Return whether rates cost, besides the jerk."""
        return any(isinstance(cost, RateCost) and not isinstance(cost, Jerk) for cost in self.all)

    @cached_property
    def function(self) -> ca.Function:
        """Return the function of what costs at an instant, (1, 1), and of the values whose rates cost, in amounts.

        Its inputs are the motions of the platform in {G} and of all carriers, then their offsets from what the task
        gives (18 each: pose, velocity, acceleration), tensions [N] (m), duration [s] and margin [N].
        """
        count = 1 + len(self.robot.carriers)
        bodies = [Body.symbols() for _ in range(2 * count)]
        tensions, duration, margin = (ca.SX.sym(name, size) for name, size in (("t", self.robot.m), ("T", 1), ("e", 1)))
        state = CostState(
            robot=self.robot,
            platform=bodies[0],
            carriers=tuple(bodies[1:count]),
            tensions=tensions,
            off_path=bodies[count].pose,
            offsets=tuple(bodies[count:]),
            duration=duration,
            margin=margin,
        )
        total, changing = ca.SX(0.0), []
        for cost in self.all:
            values = ca.SX(cost.values(state)) / cost.amount
            if isinstance(cost, Jerk):
                continue
            if isinstance(cost, RateCost):
                changing.append(ca.vec(values))
            else:
                total += ca.sumsqr(values) if cost.squared else ca.sum1(ca.vec(values))
        return of_motions("costs", bodies, [tensions, duration, margin], [total, ca.vertcat(*changing)])

    def along(
        self, times: np.ndarray, platform: Motion, carriers: Motion, tensions: np.ndarray, margin: float
    ) -> float:
        """Return the objective of a motion in {G} that has no free coordinates, at `times` (n,) [s] from 0.

        Poses, velocities and accelerations are (n, 6) and (n, c, 6) each, tensions (n, m) [N]; `margin` is the least
        distance of these from their limits, beyond the task's `margin` [N].
        """
        still = [np.zeros((len(times), 18))] * (1 + len(self.robot.carriers))
        whole = np.full((len(times), 1), times[-1]), np.full((len(times), 1), margin)
        function = self.function
        both = ca.Function("both", function.sx_in(), [ca.densify(ca.vertcat(*function(*function.sx_in())))])
        (values,) = in_blocks(both.map(BLOCK), [*motions(platform, carriers), *still, tensions, *whole])
        rates = np.diff(values[:, 1:], axis=0) / np.diff(times)[:, None]
        return float(values[:, 0].mean() + (rates**2).sum(axis=1).mean())
