"""Limits of the actuator efforts of carriers: for a quadrotor thrust and torque."""

from __future__ import annotations

import casadi as ca
import numpy as np
from typing_extensions import override

from ...models import Robot
from ...models.carriers import Effort
from .limit import Limit
from .state import State


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
        self.labels = tuple(f"{robot.carriers[index].name} {axis}".rstrip() for axis in effort.axes)
        self.scale = effort.scale or robot.force_scale

    @override
    def values(self, state: State) -> ca.SX:
        return state.efforts[self._index][self._which].values
