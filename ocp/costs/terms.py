"""The costs of a task: its terms, and `Costs`, the function that evaluates them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from typing_extensions import override

from ...base.display import Displayed
from ...models import Robot
from ...models.batch import BLOCK, in_blocks
from ...models.rotation import rotation
from ..limits.limits import Motion, motions, of_motions
from ..limits.state import Body
from .cost import Cost, CostState, RateCost


class Tension(Cost):
    """Penalise the tension of each cable."""

    name, unit = "tension", "N"

    @override
    def values(self, state: CostState) -> ca.SX:
        return state.tensions


class TensionRate(RateCost):
    """Penalise the rate of each tension."""

    name, unit = "tension_rate", "N/s"

    @override
    def values(self, state: CostState) -> ca.SX:
        return state.tensions


class PathDeviation(Cost):
    """Penalise the distance of the platform from its path, with angles times the robot's length."""

    name, unit = "deviation", "m"

    @override
    def values(self, state: CostState) -> ca.SX:
        return ca.vertcat(state.off_path[:3], state.robot.length * state.off_path[3:])


class CarrierOffset(Cost):
    """Penalise the distance of each carrier from its reference."""

    name, unit = "carrier_offset", "m, rad"

    @override
    def values(self, state: CostState) -> ca.SX:
        return ca.vertcat(*(offset.pose for offset in state.offsets[1:]))


class Formation(Cost):
    """Penalise the distance of each carrier from its place at home, which moves and yaws with the platform.

    Accelerations alone would choose any formation, such as one in which all cables of a point mass are in one plane.
    """

    name, unit = "formation", "m"

    @override
    def values(self, state: CostState) -> ca.SX:
        robot, platform = state.robot, state.platform.pose
        turned = rotation(ca.vertcat(0, 0, platform[5] - robot.home[5]))
        places = turned @ (robot.carrier_home[:, :3] - robot.home[:3]).T
        moving = [i for i, carrier in enumerate(robot.carriers) if carrier.moves]
        return ca.vertcat(*(state.carriers[i].position - platform[:3] - places[:, i] for i in moving))


class CarrierAcceleration(Cost):
    """Penalise the acceleration of each carrier relative to its reference."""

    name, unit = "carrier_acceleration", "m/s^2, rad/s^2"

    @override
    def values(self, state: CostState) -> ca.SX:
        return ca.vertcat(*(offset.acceleration for offset in state.offsets[1:]))


class Jerk(RateCost):
    """Penalise the jerk of each free coordinate; programs integrate its polynomial instead of taking differences."""

    name, unit = "jerk", "m/s^3, rad/s^3"

    @override
    def values(self, state: CostState) -> ca.SX:
        return ca.vertcat(*(offset.acceleration for offset in state.offsets))


class Time(Cost):
    """Penalise the duration of the motion."""

    name, unit, squared = "time", "s", False

    @override
    def values(self, state: CostState) -> ca.SX:
        return state.duration


class Margin(Cost):
    """Reward the least distance of the tensions from their limits."""

    name, unit, squared = "margin", "N", False

    @override
    def values(self, state: CostState) -> ca.SX:
        return -state.margin


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
