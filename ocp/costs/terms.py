"""The costs in the `objective` of a task file."""

import casadi as ca
from typing_extensions import override

from ...models.rotation import rotation
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
