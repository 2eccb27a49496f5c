"""The costs in the `objective` of a task file."""

import casadi as ca
from typing_extensions import override

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
