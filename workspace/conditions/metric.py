"""A metric in a range: natural frequency, payload, condition number or another one of `metrics`."""

from typing import Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from ...models import Robot
from ...models.part import Finite, optional
from ..condition import Condition, Places
from ..metrics import METRICS, metric_values


class MetricInRange(Condition):
    """A metric is at least `min` and at most `max`; it does not hold where the metric has no value."""

    kind: Literal["metric"] = "metric"
    metric: str = Field(description=f"one of {', '.join(METRICS)}")
    min: Finite | None = optional("minimum, in the unit of the metric; default: none")
    max: Finite | None = optional("maximum, in the unit of the metric; default: none")

    @field_validator("metric")
    @classmethod
    def _exists(cls, metric: str) -> str:
        if metric not in METRICS:
            raise ValueError(f"must be one of {', '.join(METRICS)}")
        return metric

    @model_validator(mode="after")
    def _has_a_limit(self) -> Self:
        if self.min is None and self.max is None:
            raise ValueError("min or max must be given, got neither")
        return self

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        values = metric_values(self.metric, robot, places)
        low, high = -np.inf if self.min is None else self.min, np.inf if self.max is None else self.max
        return (values >= low) & (values <= high)
