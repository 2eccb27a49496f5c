"""Limits of the platform: speed, also near places, acceleration, angular velocity, tilt and position."""

import casadi as ca
import numpy as np
from typing_extensions import override

from ...models.part import Vector3
from ...models.rotation import body_rate, rotation
from .limit import Angle, Hull, Limit, Magnitude
from .state import State

STEEPNESS = 10.0  # [1/s], of the bound of a speed outside of its zone
TOLERANCE = 1e-7  # [m, rad]


class PlatformSpeed(Magnitude):
    """Limit the speed of the platform frame's origin."""

    name, unit = "platform_speed", "m/s"

    @override
    def values(self, state: State) -> ca.SX:
        return state.platform.velocity[:3]


class ZoneSpeed(Magnitude):
    """Limit the speed of the platform frame's origin within a distance of a place.

    Outside, the bound rises with the distance, by `STEEPNESS`: a bound that ends at once has no derivative, and no
    instant at which a motion has to be slow enough.
    """

    name, unit = "zone_speed", "m/s"

    def __init__(self, name: str, centre: Vector3, radius: float, most: float):
        super().__init__(most)
        self._centre, self._radius, self.labels = centre, radius, (f"platform near {name}",)

    def bound(self, positions: np.ndarray) -> np.ndarray:
        """Return the largest speed at positions (n, 3) [m], (n,) [m/s]."""
        return self.high + STEEPNESS * np.maximum(self._outside(positions)[:, 0], 0.0)

    def way(self, positions: np.ndarray) -> np.ndarray:
        """Return how far positions (..., 3) are from the centre, in metres inside the zone, (..., 1).

        A metre outside counts for less, as the bound rises: no motion that keeps the limit changes this any faster.
        """
        outside, slow = self._outside(positions), self.high / STEEPNESS
        return self._radius + np.where(outside < 0, outside, slow * np.log1p(np.maximum(outside, 0.0) / slow))

    def _outside(self, positions: np.ndarray) -> np.ndarray:
        return np.linalg.norm(positions - self._centre, axis=-1, keepdims=True) - self._radius

    @override
    def values(self, state: State) -> ca.SX:
        from_centre = ca.sumsqr(state.platform.position - ca.DM(self._centre)) / self._radius**2
        # At least one under the root, which has no derivative at zero.
        outside = self._radius * (ca.sqrt(ca.fmax(from_centre, 1)) - 1)
        return state.platform.velocity[:3] / (1 + STEEPNESS * outside / self.high)


class PlatformAcceleration(Magnitude):
    """Limit the acceleration of the platform frame's origin."""

    name, unit = "platform_acceleration", "m/s^2"

    @override
    def values(self, state: State) -> ca.SX:
        return state.platform.acceleration[:3]


class PlatformLateralAcceleration(Magnitude):
    """Limit acceleration minus gravity along the platform's x and y axes, which makes an open cup spill."""

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
        self.labels = (f"platform along {'xyz'[axis]}",)

    @override
    def values(self, state: State) -> ca.SX:
        return state.platform.pose[self._axis]


class TubePosition(Magnitude):
    """Limit the distance of the platform from its path."""

    name, unit = "tube.position", "m"
    hull = Hull(None, 0, (0, 1, 2))

    def __init__(self, radius: float):
        super().__init__(radius)
        self.shown = radius > 0

    @override
    def values(self, state: State) -> ca.SX:
        return state.off_path[:3]

    @property
    @override
    def tolerance(self) -> float:
        return TOLERANCE


class TubeAttitude(Limit):
    """Limit the deviation of one angle of the platform from its path."""

    name, unit = "tube.attitude", "rad"

    def __init__(self, axis: int, turn: float):
        self._axis = axis
        self.labels = (f"platform {('roll', 'pitch', 'yaw')[axis]}",)
        self.low, self.high, self.scale = -turn, turn, turn
        self.hull = Hull(None, 0, (3 + axis,), at_ends=False)
        self.shown = turn > 0

    @override
    def values(self, state: State) -> ca.SX:
        return state.off_path[3 + self._axis]

    @property
    @override
    def tolerance(self) -> float:
        return TOLERANCE
