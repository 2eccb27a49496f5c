"""Bodies in space as data: what cables, platform and carriers must keep away from."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from .part import Part, Positive, Vector3

__all__ = ["Block", "Capsule", "Sphere"]


class Sphere(Part):
    """A ball."""

    kind: Literal["sphere"]
    centre: Vector3 = Field(description="in its frame [m]")
    radius: Positive = Field(description="[m]")


class Capsule(Part):
    """All points within `radius` of the line from `start` to `end`."""

    kind: Literal["capsule"]
    start: Vector3 = Field(description="in its frame [m]")
    end: Vector3 = Field(description="in its frame [m]")
    radius: Positive = Field(description="[m]")


class Block(Part):
    """A box along the axes of its frame."""

    kind: Literal["box"]
    min: Vector3 = Field(description="corner in its frame [m]")
    max: Vector3 = Field(description="corner in its frame [m]")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if any(low >= high for low, high in zip(self.min, self.max, strict=True)):
            raise ValueError(f"min must be smaller than max in each coordinate, got {self.min} and {self.max}")
        return self
