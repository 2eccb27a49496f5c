"""A cable as data: from its anchor to its attachment, with pulley, winch and encoder."""

from typing import Self

from pydantic import Field, field_validator, model_validator

from .part import Direction, Finite, Name, NonNegative, Part, Positive, Vector3, optional


class Pulley(Part):
    """A swivelling pulley: the cable comes up the swivel axis at the anchor and leaves the sheave tangentially.

    The sheave's plane contains the axis and turns about it so that it also contains the attachment.
    """

    radius: Positive = Field(description="radius of the sheave [m]")
    axis: Direction = optional("swivel axis in the carrier frame, of any length", (0.0, 0.0, 1.0))


class Winch(Part):
    """A winch, modelled as a mass on the cable that the motor's force and the tension accelerate, within limits."""

    inertia: Positive = Field(description="inertia of rotor, gear and drum, as an equivalent mass on the cable [kg]")
    friction: NonNegative = optional("dry friction, as a force on the cable [N]", 0.0)
    speed_max: Positive = Field(description="largest speed of the cable [m/s]")
    force_max: Positive = Field(
        description="largest force of the motor on the cable; tensions are at most this less `friction` [N]"
    )

    @model_validator(mode="after")
    def _stronger_than_its_friction(self) -> Self:
        if self.friction >= self.force_max:
            raise ValueError(f"friction must be below force_max, {self.force_max:g} N, got {self.friction:g} N")
        return self

    @property
    def tension_max(self) -> float:
        """Return the largest tension [N] with which it can begin to haul in: the motor's force minus friction."""
        return self.force_max - self.friction


class Encoder(Part):
    """The reading y of a winch: the unstrained length of the cable is offset + scale * y + build_up * y^2."""

    offset: Finite = optional("length of the cable at reading 0 [m]", 0.0)
    scale: Finite = optional("metres of cable per unit of the reading, not 0", 1.0)
    build_up: Finite = optional(
        "effect of the layers of cable on the drum, as length per square of the reading [1/m]", 0.0
    )

    @field_validator("scale")
    @classmethod
    def _changes_with_the_reading(cls, scale: float) -> float:
        if scale == 0:
            raise ValueError("must be a number other than 0")
        return scale


class Cable(Part):
    """One cable, from its anchor on a carrier to its attachment on the platform. It pulls and never pushes."""

    carrier: Name = Field(description="name of the carrier that holds its anchor")
    anchor: Vector3 = Field(description="point A_i on the carrier, in its frame [m]")
    attachment: Vector3 = Field(description="point B_i on the platform, in its frame [m]")
    t_min: NonNegative = Field(description="smallest tension [N]; above zero keeps the cable taut")
    t_max: Positive = Field(description="largest tension [N]")
    stiffness: Positive | None = optional("axial stiffness E A [N]; default: inextensible")
    damping: NonNegative | None = optional("damping C of an elastic cable [N s/m]; default: none")
    length: Positive | None = optional(
        "constant length, for the drive fixed-length [m]; default: from anchor to attachment at home"
    )
    pulley: Pulley | None = optional("swivelling pulley at the anchor; default: none, the anchor is a point")
    winch: Winch | None = optional("winch of the cable; default: its length follows commands exactly")
    encoder: Encoder | None = optional(
        "relation between the reading of the winch and the length; default: they are equal"
    )

    @model_validator(mode="after")
    def _limits_in_order(self) -> Self:
        if self.t_min > self.t_max:
            raise ValueError(f"t_min must not exceed t_max ({self.t_max:g} N), got {self.t_min:g} N")
        return self
