"""Limits of the tube: the distance of the platform from its path."""

import casadi as ca
from typing_extensions import override

from .limit import Hull, Limit, Magnitude
from .state import State

TOLERANCE = 1e-7  # [m, rad]


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
