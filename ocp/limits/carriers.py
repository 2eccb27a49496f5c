"""Limits of the carriers: motion, positions, and distances between carriers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import casadi as ca
import numpy as np
from typing_extensions import override

from ...models import Robot
from ...models.carriers import Effort
from .clearance import between_points
from .distance import Distance, Pair
from .limit import Angle, Hull, Limit, Magnitude
from .state import State


class _Motion(Magnitude):
    """Limit the first or second `derivative` of a carrier's position."""

    derivative: int

    def __init__(self, robot: Robot, index: int, most: float):
        super().__init__(most)
        self.labels = (robot.carriers[index].name,)
        self.hull = Hull(index, self.derivative, (0, 1, 2))
        self._index = index

    @override
    def values(self, state: State) -> ca.SX:
        return state.carriers[self._index][self.derivative][:3]


class CarrierSpeed(_Motion):
    """Limit the speed of a carrier."""

    name, unit, derivative = "carrier_speed", "m/s", 1


class CarrierAcceleration(_Motion):
    """Limit the acceleration of a carrier."""

    name, unit, derivative = "carrier_acceleration", "m/s^2", 2


class CarrierTilt(Angle):
    """Limit the angle of a carrier's z axis to the vertical, below 90 degrees."""

    name = "carrier_tilt"

    def __init__(self, robot: Robot, index: int, most: float):
        super().__init__(most)
        self.labels = (robot.carriers[index].name,)
        self.hull = Hull(index, 0, (3, 4))  # {cos r cos p >= c} is convex
        self._index = index

    @override
    def values(self, state: State) -> ca.SX:
        return state.carriers[self._index].upright


class CarrierTurnAcceleration(Limit):
    """Limit the second derivatives of a carrier's roll and pitch."""

    name, unit = "carrier_turn_acceleration", "rad/s^2"

    def __init__(self, robot: Robot, index: int, most: float):
        carrier = robot.carriers[index].name
        self.labels = (f"{carrier} roll", f"{carrier} pitch")
        self.low, self.high, self.scale = -most, most, most
        self.hull = Hull(index, 2, (3, 4))
        self._index = index

    @override
    def values(self, state: State) -> ca.SX:
        return state.carriers[self._index].acceleration[3:5]


class CarrierReach(Limit):
    """Keep one coordinate of a carrier in {G} inside its reach box. Figures draw the box in space instead."""

    name, unit, shown = "carrier_reach", "m", False

    def __init__(self, robot: Robot, index: int, axis: int, low: float, high: float):
        self.labels = (f"{robot.carriers[index].name} along {'xyz'[axis]}",)
        self.low, self.high = low, high
        self.hull = Hull(index, 0, (axis,))
        self._index, self._axis = index, axis

    @override
    def values(self, state: State) -> ca.SX:
        return state.carriers[self._index].pose[self._axis]


class CarrierSeparation(Distance):
    """Keep the origins of pairs of carriers apart; default: of all."""

    name = "carrier_separation"

    def __init__(self, robot: Robot, least: float, pairs: Sequence[tuple[int, int]] | None = None):
        self.low, self.scale = least, least
        self._pairs = list(combinations(range(len(robot.carriers)), 2)) if pairs is None else pairs
        self.labels = tuple(f"{robot.carriers[i].name} and {robot.carriers[j].name}" for i, j in self._pairs)

    @override
    def pairs(self, state: State) -> list[Pair]:
        at = [carrier.position for carrier in state.carriers]
        return [Pair(at[i], at[j]) for i, j in self._pairs]

    @override
    def apart(self, pair: Pair) -> ca.SX:
        return between_points(pair.points, pair.others)


def efforts(robot: Robot, index: int) -> list[CarrierEffort]:
    """Return the effort limits of carrier `index`; none if its motion is imposed."""
    zero = ca.DM.zeros(6)
    required = robot.carriers[index].required_effort(zero, zero, zero, zero, np.array(robot.gravity))
    return [CarrierEffort(robot, index, which, effort) for which, effort in enumerate(required)]


class CarrierEffort(Limit):
    """Keep one effort of a carrier inside its range. The carrier has the formula (`Carrier.required_effort`)."""

    def __init__(self, robot: Robot, index: int, which: int, effort: Effort):
        self._index, self._which = index, which
        self.name, self.unit, self.low, self.high = effort.name, effort.unit, effort.low, effort.high
        way = " about " if effort.unit == "N m" else " along "
        self.labels = tuple(robot.carriers[index].name + (way + axis if axis else "") for axis in effort.axes)
        self.scale = effort.scale or robot.force_scale

    @override
    def values(self, state: State) -> ca.SX:
        return state.efforts[self._index][self._which].values
