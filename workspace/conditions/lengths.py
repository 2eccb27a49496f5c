"""Length limits: every cable is as long as its winch allows."""

from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from ...base.errors import InputError
from ...models import Robot
from ...models.dynamics import dynamics_of
from ...models.part import NonNegative, Positive, optional
from ..condition import Condition, Places


class Lengths(Condition):
    """Each cable's length lies between a minimum and a maximum."""

    kind: Literal["lengths"] = "lengths"
    min: NonNegative | tuple[NonNegative, ...] = optional("minimum of all cables or of each [m]", 0.0)
    max: Positive | tuple[Positive, ...] | None = optional("maximum of all cables or of each [m]; default: unlimited")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        least, most = np.atleast_1d(self.min), np.atleast_1d(np.inf if self.max is None else self.max)
        if self.max is None and not least.any():
            raise ValueError("min above 0 or max must be given, got neither")
        # If min and max have different numbers of cables, one of them does not fit the robot: `evaluate` reports it.
        if (1 in (least.size, most.size) or least.size == most.size) and np.greater(least, most).any():
            raise ValueError(f"min must not exceed max, {self.max} m, got {self.min} m")
        return self

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        for name, value in (("min", self.min), ("max", self.max)):
            if isinstance(value, tuple) and len(value) != robot.m:
                raise InputError(f"lengths.{name} must have one number or {robot.m}, one per cable, got {len(value)}")
        lengths = dynamics_of(robot).cable_lengths(places.pose, places.carriers)
        most = np.inf if self.max is None else self.max
        return np.all((lengths >= self.min) & (lengths <= most), axis=1)
