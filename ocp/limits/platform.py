"""Limits of the platform: speed, acceleration, angular velocity, tilt and position."""

import casadi as ca
from typing_extensions import override

from ...models.rotation import body_rate, rotation
from .limit import Angle, Limit, Magnitude
from .state import State


class PlatformSpeed(Magnitude):
    """Limit the speed of the platform frame's origin."""

    name, unit = "platform_speed", "m/s"

    @override
    def values(self, state: State) -> ca.SX:
        return state.platform.velocity[:3]


class PlatformAcceleration(Magnitude):
    """Limit the acceleration of the platform frame's origin."""

    name, unit = "platform_acceleration", "m/s^2"

    @override
    def values(self, state: State) -> ca.SX:
        return state.platform.acceleration[:3]


class PlatformLateralAcceleration(Magnitude):
    """Limit what an open cup on the platform feels sideways: acceleration less gravity in the platform's x and y."""

    name, unit = "platform_lateral_acceleration", "m/s^2"

    @override
    def values(self, state: State) -> ca.SX:
        felt = state.platform.acceleration[:3] - ca.DM(state.robot.gravity)
        return (rotation(state.platform.pose[3:6]).T @ felt)[:2]


class PlatformTurn(Magnitude):
    """Limit the platform's angular velocity."""

    name, unit = "platform_turn", "rad/s"

    @override
    def values(self, state: State) -> ca.SX:
        return body_rate(state.platform.pose[3:6], state.platform.velocity[3:6])


class PlatformTilt(Angle):
    """Limit the angle of the platform's z axis to the vertical."""

    name = "platform_tilt"

    @override
    def values(self, state: State) -> ca.SX:
        return state.platform.upright


class PlatformBox(Limit):
    """Keep one coordinate of the platform frame's origin in {G} inside a range."""

    name, unit, per_metre = "platform_box", "m", 1.0

    def __init__(self, axis: int, low: float, high: float):
        self._axis, self.low, self.high = axis, low, high
        self.labels = (f"platform {'xyz'[axis]}",)

    @override
    def values(self, state: State) -> ca.SX:
        return state.platform.pose[self._axis]
