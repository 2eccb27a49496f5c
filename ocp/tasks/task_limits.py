"""`TaskLimits`: the limits of a task besides tensions: speeds, cables, distances, keep-out regions."""

from __future__ import annotations

import difflib
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer, model_validator
from pydantic.json_schema import SkipJsonSchema

from ...models import shapes
from ...models.part import Box, NonNegative, Part, Positive, Range, Tilt, Vector3, optional
from ...models.shapes import THINNEST
from ..limits.limit import Limit

Distance = Annotated[NonNegative | None, Field(description="least distance [m]; null: no limit")]


# Limits of the robot's file and the task's base, by their names in `soft`.
OF_CARRIERS = (
    "carrier_speed",
    "carrier_acceleration",
    "carrier_tilt",
    "carrier_turn_acceleration",
    "carrier_reach",
    "thrust",
    "torque",
)


# Limits that come from places in the frame of the platform.
OF_BODY = ("cable_platform_clearance", "carrier_platform_clearance")


class KeepOut(Part):
    """The base of all keep-out regions: the clearances of platform, carriers and cables.

    The platform is its body, or without one its CoM and its attachments, a cable is the line between its ends, and a
    moving carrier its origin. The default clearance of a carrier is the radius of its body, so that the rotors of a
    quadrotor do not touch the region; a number replaces the radius. A region in the frame of the platform moves with
    it, and cables and carriers keep out of it; for the platform's own body, the limits cable_platform_clearance and
    carrier_platform_clearance do the same. Cables end at their attachments, so such a region must not contain these.
    """

    name: str = optional("name for reports and figures", "obstacle", min_length=1, max_length=60)
    frame: Literal["world", "platform"] = optional(
        "world: fixed in {G}; platform: it moves with the platform, and cables and carriers keep out of it", "world"
    )
    platform: Distance = 0.0
    carriers: NonNegative | Literal["radius"] | None = optional(
        "least distance of the origins of moving carriers [m]; radius: the radius of each carrier's body, such "
        "as a quadrotor with its rotors; null: no limit",
        "radius",
    )
    cables: Distance = 0.0

    def touched(self) -> Self:
        """Return the region without clearances, except those that are null."""
        return self.model_copy(
            update={name: 0.0 for name in ("platform", "carriers", "cables") if getattr(self, name) is not None}
        )

    @model_serializer(mode="wrap")
    def _with_nulls(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Keep distances that are null: files leave out what is null elsewhere, and here that would be a limit."""
        nulls = {name: None for name in ("platform", "carriers", "cables") if getattr(self, name) is None}
        return {**handler(self), **nulls}

    @model_validator(mode="after")
    def _thick_enough(self) -> Self:
        thickness = getattr(self, "thickness", np.inf)  # each subclass adds the thickness of its shape
        if thickness < THINNEST:
            raise ValueError(f"must be at least {THINNEST:g} m thick, got {thickness:.3g} m")
        return self


class Sphere(KeepOut, shapes.Sphere):
    """A ball to keep out of."""


class Capsule(KeepOut, shapes.Capsule):
    """A capsule to keep out of."""


class Block(KeepOut, shapes.Block):
    """A box to keep out of."""


class ConvexMesh(KeepOut, shapes.ConvexMesh):
    """A convex body with plane faces to keep out of: an STL file, or the hull of points."""


AnyKeepOut = Annotated[Sphere | Capsule | Block | ConvexMesh, Field(discriminator="kind")]


class SpeedZone(Part):
    """A ball in which the speed of the platform is limited."""

    name: str = optional("name for reports and figures", "zone", min_length=1, max_length=60)
    centre: Vector3 = Field(description="centre in {G} [m]")
    radius: Positive = Field(description="radius [m]")
    speed: Positive = Field(description="largest speed of the platform frame's origin inside [m/s]")


class TaskLimits(Part):
    """The limits of a task; default: no limit. Each is hard unless `soft` names it.

    Attributes:
        soft: By name of a limit, the excess that adds 1 to the objective, in the limit's unit; twice the excess adds 4.
            The task's `margin` and carriers' own limits can be soft too: carrier_speed, carrier_acceleration,
            carrier_tilt, carrier_turn_acceleration, carrier_reach, thrust, torque.
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    cable_speed: Positive | None = optional(
        "rate of every cable's length, the speed of its winch, in addition to the robot file's limit [m/s]"
    )
    cable_acceleration: Positive | None = optional(
        "second derivative of every cable's length, the acceleration of its winch [m/s^2]"
    )
    cable_jerk: Positive | None = optional("third derivative of every cable's length, the jerk of its winch [m/s^3]")
    winch_power: Positive | None = optional("mechanical power of every winch, tension times rate of the length [W]")
    cable_length: Range | None = optional("range of every cable's length [m]")
    natural_frequency: Positive | None = optional(
        "lowest natural frequency of the platform on elastic cables, with the planned tensions and fixed "
        "unstrained lengths; always hard [Hz]"
    )
    tension_rate: Positive | None = optional("rate of every tension [N/s]")
    platform_speed: Positive | None = optional("speed of the platform frame's origin [m/s]")
    zone_speed: tuple[SpeedZone, ...] = optional(
        "balls with a speed limit, which rises by 10 m/s per metre of distance from the ball", ()
    )
    platform_acceleration: Positive | None = optional("acceleration of the platform frame's origin [m/s^2]")
    platform_lateral_acceleration: Positive | None = optional(
        "acceleration minus gravity along the platform's x and y axes, which makes an open cup spill [m/s^2]"
    )
    platform_turn: Positive | None = optional("angular velocity of the platform [rad/s]")
    platform_tilt: Tilt | None = optional("angle of the platform's z axis to the vertical [rad]")
    platform_box: Box | None = optional("box in {G} in which the platform frame's origin stays [m]")
    carrier_speed: Positive | None = optional(
        "speed of every moving carrier, in addition to the robot file's limit [m/s]"
    )
    carrier_acceleration: Positive | None = optional(
        "acceleration of every moving carrier, in addition to the robot file's limit [m/s^2]"
    )
    cable_clearance: Positive | None = optional(
        "least distance between cables that share neither anchor nor attachment [m]"
    )
    carrier_separation: Positive | Literal["radius"] | None = optional(
        "least distance between the origins of carriers [m]; radius: the sum of the radii of the two carriers' bodies"
    )
    cable_platform_clearance: Distance = optional(
        "least distance between cables and the bodies of platform and load [m]"
    )
    carrier_platform_clearance: NonNegative | Literal["radius"] | None = optional(
        "least distance between the origins of moving carriers and the bodies of platform and load [m]; "
        "radius: the radius of each carrier's body"
    )
    keep_out: tuple[AnyKeepOut, ...] = optional("keep-out regions", ())
    soft: dict[str, Positive] = optional(
        "limits that may be exceeded, by name: the excess that adds 1 to the objective; twice the excess adds 4", {}
    )
    own: SkipJsonSchema[tuple[Limit, ...]] = Field(
        default=(), exclude=True, description="limits of your own, in Python alone (docs/adding-a-limit.md)"
    )

    @model_validator(mode="after")
    def _soft_ones_exist(self) -> Self:
        apart = ("soft", "keep_out", "own", "natural_frequency", *OF_CARRIERS)
        of_task = [name for name in type(self).model_fields if name not in apart]
        given = [name for name in of_task if getattr(self, name) not in (None, ())]
        frames = {place.frame for place in self.keep_out}
        given += ["keep_out"] * ("world" in frames) + list(OF_BODY) * ("platform" in frames)
        given += [limit.name for limit in self.own]
        for name in self.soft:
            if name not in (*given, "margin", *OF_CARRIERS):
                names = (*given, "margin", *OF_CARRIERS)
                close = difflib.get_close_matches(name, names, n=1)
                meant = f", did you mean {close[0]!r}?" if close else ""
                raise ValueError(f"soft must name limits of this task ({', '.join(names)}), got {name!r}{meant}")
        return self

    def without_own(self) -> TaskLimits:
        """Return the limits for a file, without `own`."""
        names = {limit.name for limit in self.own}
        kept = {name: amount for name, amount in self.soft.items() if name not in names}
        return self.model_copy(update={"own": (), "soft": kept})
