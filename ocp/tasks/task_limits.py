"""What a task limits beside the tensions, as data: speeds, cables, distances, places to keep out of."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ...models import shapes
from ...models.robot import Box, Finite, NonNegative, Part, Positive

Distance = Annotated[NonNegative | None, Field(description="[m]; null: may be anywhere")]


# Limits that the robot's file and the task's base have, under the names that `soft` knows them by.
OF_CARRIERS = (
    "carrier_speed",
    "carrier_acceleration",
    "carrier_tilt",
    "carrier_turn_acceleration",
    "carrier_reach",
    "thrust",
    "torque",
)


# Limits that places in the frame of the platform make.
OF_BODY = ("cable_platform_clearance", "carrier_platform_clearance")


class KeepOut(Part):
    """What all places to keep out of share: by how much platform, carriers and cables stay outside.

    The platform counts as its CoM and its attachments, a carrier that can move as its origin, a cable as the line
    between its ends. A place in the frame of the platform rides along with it: so the platform's own body is kept clear
    of cables and carriers, limits known as cable_platform_clearance and carrier_platform_clearance. Cables end at their
    attachments, so such a body has to leave these outside.
    """

    name: str = Field(default="obstacle", min_length=1, max_length=60)
    frame: Literal["world", "platform"] = Field(
        default="world",
        description="world: the place stands in {G}; platform: it rides along, and cables and carriers keep out of it",
    )
    platform: Distance = 0.0
    carriers: Distance = 0.0
    cables: Distance = 0.0


class Sphere(KeepOut, shapes.Sphere):
    """A ball to keep out of."""


class Capsule(KeepOut, shapes.Capsule):
    """A capsule to keep out of."""


class Block(KeepOut, shapes.Block):
    """A box to keep out of."""


AnyKeepOut = Annotated[Sphere | Capsule | Block, Field(discriminator="kind")]


class Range(Part):
    """From min to max."""

    min: Finite
    max: Finite

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.min > self.max:
            raise ValueError(f"min: {self.min:g} is more than max: {self.max:g}; accepted: min <= max")
        return self


class TaskLimits(Part):
    """Limits of this task; null: none. Each is hard unless `soft` names it.

    Attributes
    ----------
    soft :
        By name of a limit, how much beyond it costs as much as one of the objective's numbers, in the limit's unit.
        The task's `margin` and carriers' own limits can be soft too: carrier_speed, carrier_acceleration, carrier_tilt,
        carrier_turn_acceleration, carrier_reach, thrust, torque.
    """

    cable_speed: Positive | None = Field(default=None, description="of every cable's length, the winch [m/s]")
    cable_length: Range | None = Field(default=None, description="of every cable [m]")
    tension_rate: Positive | None = Field(default=None, description="of every tension [N/s]")
    platform_speed: Positive | None = Field(default=None, description="of its frame's origin [m/s]")
    platform_acceleration: Positive | None = Field(default=None, description="of its frame's origin [m/s^2]")
    platform_turn: Positive | None = Field(default=None, description="angular velocity [rad/s]")
    platform_tilt: Positive | None = Field(default=None, le=np.pi, description="of its z axis from the vertical [rad]")
    platform_box: Box | None = Field(default=None, description="where its frame's origin may be, in {G} [m]")
    cable_clearance: Positive | None = Field(
        default=None, description="between cables that share neither anchor nor attachment [m]"
    )
    carrier_separation: Positive | None = Field(default=None, description="between the origins of carriers [m]")
    keep_out: tuple[AnyKeepOut, ...] = Field(default=(), description="places to keep out of")
    soft: dict[str, Positive] = Field(default={}, description="amount beyond a limit that costs one, by its name")

    @model_validator(mode="after")
    def _soft_ones_exist(self) -> Self:
        given = [name for name in type(self).model_fields if name not in ("soft", "keep_out") and getattr(self, name)]
        frames = {place.frame for place in self.keep_out}
        given += ["keep_out"] * ("world" in frames) + list(OF_BODY) * ("platform" in frames)
        for name in self.soft:
            if name not in (*given, "margin", *OF_CARRIERS):
                accepted = ", ".join((*given, "margin", *OF_CARRIERS))
                raise ValueError(f"soft: {name!r} is none of this task's limits; accepted: {accepted}")
        return self
