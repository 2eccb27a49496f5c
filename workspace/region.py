"""`Region`: where to look, as data: a box of positions, attitudes, places of the carriers, cable lengths."""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ..models import Robot
from ..models.ranges import PositiveRange
from ..models.robot import Box, MobileCarrier, Name, Part, Vector3


class AngleBox(Part):
    """A box of attitudes (roll, pitch, yaw) [rad]."""

    min: Vector3
    max: Vector3

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for angle, low, high in zip(("roll", "pitch", "yaw"), self.min, self.max, strict=True):
            if low > high:
                raise ValueError(f"min must not exceed max, but of {angle} min is {low:g} and max is {high:g}")
        return self


class Region(Part):
    """Where to look. What has equal ends stays there: a slice is a box without thickness.

    Samples are uniform in each of the quantities that vary, which are independent of each other.
    """

    position: Box | None = Field(
        default=None, description="of the platform frame in {G} [m]; none: a box about home and anchors"
    )
    attitude: Vector3 | AngleBox | None = Field(
        default=None, description="(roll, pitch, yaw) or a box of them [rad]; none: that of home"
    )
    carriers: Literal["home", "reach"] | dict[Name, Box] = Field(
        default="home",
        description="home; reach: each mobile carrier anywhere in its reach box; or boxes of carriers in {G} by name",
    )
    lengths: PositiveRange | None = Field(
        default=None,
        description="of each of three cables [m]; the position then follows from carriers, attitude and lengths, and "
        "is the lower of the two there are",
    )

    @model_validator(mode="after")
    def _says_position_once(self) -> Self:
        if self.position is not None and self.lengths is not None:
            raise ValueError("position and lengths are both given; accepted: one of them, each tells where it is")
        return self


def surrounding_box(robot: Robot, carriers: dict[str, Box]) -> tuple[np.ndarray, np.ndarray]:
    """A box of positions about home and anchors, (3,) and (3,) [m]; locked coordinates stay at home.

    Parameters
    ----------
    carriers
        Boxes that carriers may be in, by name; the others are at home.
    """
    corners = [robot.home_anchors, robot.home[None, :3]]
    for index, carrier in enumerate(robot.carriers):
        if carrier.name in carriers:
            own = robot.home_anchors[robot.carrier_of_cable == index] - carrier.home[:3]
            corners += [own + carriers[carrier.name].min, own + carriers[carrier.name].max]
    every = np.vstack(corners)
    low, high = every.min(axis=0), every.max(axis=0)
    # A robot on top of its anchors, or below them, has room there too.
    spread = np.maximum(high - low, 0.5 * (high - low).max())
    low = np.minimum(low, (low + high - spread) / 2)
    moving = robot.dof_mask[:3] > 0
    return np.where(moving, low, robot.home[:3]), np.where(moving, low + spread, robot.home[:3])


def reach_boxes(robot: Robot) -> dict[str, Box]:
    """Reach boxes of the mobile carriers, by name."""
    return {carrier.name: carrier.reach for carrier in robot.carriers if isinstance(carrier, MobileCarrier)}
