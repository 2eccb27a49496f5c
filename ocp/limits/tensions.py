"""Limits of the tensions besides t_min and t_max: margin and rates."""

import casadi as ca
from typing_extensions import override

from ...models import Robot
from .cables import EachCable, names
from .limit import Limit, Rate
from .state import State


class Margin(Limit):
    """Keep each tension inside its limits by a margin. Only soft: a hard margin bounds the tensions themselves."""

    name, unit = "margin", "N"

    def __init__(self, robot: Robot, least: float):
        self.low, self.scale = least, robot.force_scale
        self.labels = names(robot) * 2

    @override
    def values(self, state: State) -> ca.SX:
        low, high = ca.DM(state.robot.t_min), ca.DM(state.robot.t_max)
        return ca.vertcat(state.tensions - low, high - state.tensions)


class TensionRate(EachCable, Rate):
    """Limit the rate of each tension."""

    name, unit = "tension_rate", "N/s"

    @override
    def values(self, state: State) -> ca.SX:
        return state.tensions
