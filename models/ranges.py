"""Ranges of one number, as files give them: `{min: ..., max: ...}`."""

from typing import Self

from pydantic import Field, model_validator

from .part import Finite, Part, Positive


class Range(Part):
    """The numbers from min to max, both included."""

    min: Finite = Field(description="smallest value")
    max: Finite = Field(description="largest value")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.min > self.max:
            raise ValueError(f"min must be at most max, {self.max:g}, got {self.min:g}")
        return self


class PositiveRange(Range):
    """The positive numbers from min to max, both included."""

    min: Positive = Field(description="smallest value, positive")
    max: Positive = Field(description="largest value, positive")
