"""A robot as data: one platform, the carriers that hold its cables, and the cables. Only checks are computed.

SI units throughout: metres, kilograms, seconds, newtons, radians. {G} is the global frame (down is where
gravity points), the platform frame sits on the platform, a carrier frame on each carrier. Poses are (x, y, z, roll,
pitch, yaw) with R = Rz(yaw) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, Self, cast

import numpy as np
from pydantic import Field, field_validator, model_validator

from . import parameters, points
from .carriers import AnyCarrier, Drive
from .displayed_robot import DisplayedRobot
from .drive import lengths_to_keep, usual_drive
from .part import (
    COORDINATES,
    BodyInertia,
    Coordinate,
    Finite,
    Name,
    NonNegative,
    Part,
    Pose,
    Positive,
    Vector3,
    inertia_matrix,
)
from .pulleys import check_pulleys
from .uncertainty import Uncertainty, draw

# Sets with angles for which the wrench rows about the CoM are the equations of these coordinates. About a fixed pivot,
# or with fewer axes, the reactions of what is locked would enter them.
TURNING_DOF: tuple[tuple[Coordinate, ...], ...] = (
    COORDINATES,
    ("x", "z", "pitch"),
    ("x", "y", "yaw"),
    ("y", "z", "roll"),
    ("x", "y", "z", "yaw"),
)


class Aero(Part):
    """The force of the air on the platform (paper F, Eq. 25).

    The force acts at the CoM along the axes of {G}: along x and y with the drag coefficient, along z with the lift
    coefficient; V is the air's velocity relative to the platform.
    """

    air_density: Positive = Field(description="rho [kg/m^3]")
    drag: NonNegative = Field(description="drag coefficient C_d [-]")
    lift: NonNegative = Field(description="lift coefficient C_l [-]")
    area: Positive = Field(description="largest cross-section S of the platform [m^2]")
    form: Literal["signed", "printed"] = Field(
        default="signed", description="signed: V abs(V), as drag acts; printed: V^2, never negative, as in paper F"
    )


class Platform(Part):
    """The rigid body that the cables pull."""

    mass: Positive = Field(description="[kg]")
    inertia: BodyInertia | None = Field(
        default=None,
        description="(Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the CoM in platform axes, tensor signs [kg m^2]; "
        "required unless the platform cannot turn",
    )
    com: Vector3 = Field(default=(0.0, 0.0, 0.0), description="CoM in the platform frame [m]")
    home: Pose | None = Field(
        default=None,
        description="pose in {G} to start from and to diagnose at [m, rad]; default: level, amid or below the anchors",
    )
    dof: tuple[Coordinate, ...] = Field(
        default=COORDINATES,
        min_length=1,
        description="coordinates that can move; a point mass has x, y, z. The cables balance only the rows of these",
    )
    aero: Aero | None = Field(
        default=None, description="how the air pushes the platform; default: without it no wind can be given"
    )

    @field_validator("dof")
    @classmethod
    def _in_order(cls, dof: tuple[Coordinate, ...]) -> tuple[Coordinate, ...]:
        if len(set(dof)) != len(dof):
            raise ValueError("must name each coordinate once")
        ordered: tuple[Coordinate, ...] = tuple(name for name in COORDINATES if name in dof)
        turning = [name for name in ordered if name in COORDINATES[3:]]
        if turning and ordered not in TURNING_DOF:
            sets = "; ".join(", ".join(names) for names in TURNING_DOF)
            raise ValueError(f"must be any of x, y, z; or {sets}")
        return ordered

    @model_validator(mode="after")
    def _turns_with_inertia(self) -> Self:
        if self.inertia is None and any(name in self.dof for name in COORDINATES[3:]):
            raise ValueError(
                "inertia must be (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) [kg m^2] unless dof has no angles, got none"
            )
        locked = [name for name in COORDINATES[3:] if name not in self.dof]
        if self.home and len(locked) < 3 and any(self.home[COORDINATES.index(name)] for name in locked):
            angles = ", ".join(f"{self.home[COORDINATES.index(name)]:g}" for name in locked)
            raise ValueError(f"home must have 0 rad for {', '.join(locked)}, which cannot move, got {angles}")
        return self


class Pulley(Part):
    """A swivelling pulley: the cable comes up the swivel axis at the anchor, runs over the sheave, leaves tangentially.

    The sheave's plane holds the axis and turns about it so that it also holds the attachment.
    """

    radius: Positive = Field(description="of the sheave [m]")
    axis: Vector3 = Field(
        default=(0.0, 0.0, 1.0), description="swivel axis in the carrier frame, need not be of unit length"
    )

    @field_validator("axis")
    @classmethod
    def _has_a_direction(cls, axis: Vector3) -> Vector3:
        if not np.linalg.norm(axis) > 0:
            raise ValueError("must be a direction other than zero")
        return axis


class Winch(Part):
    """A winch as its cable feels it: an inertia that the motor's force and the tension accelerate, inside limits."""

    inertia: Positive = Field(description="of rotor, gear and drum, as a mass on the cable [kg]")
    friction: NonNegative = Field(default=0.0, description="dry friction, as a force on the cable [N]")
    speed_max: Positive = Field(description="largest speed of the cable [m/s]")
    force_max: Positive = Field(description="largest force of the motor on the cable [N]")


class Encoder(Part):
    """The reading of a winch: the length from anchor to attachment is offset + scale * reading."""

    offset: Finite = Field(default=0.0, description="length of the cable where the reading is 0 [m]")
    scale: Finite = Field(default=1.0, description="length for each unit of the reading [m], not 0")

    @field_validator("scale")
    @classmethod
    def _changes_with_the_reading(cls, scale: float) -> float:
        if scale == 0:
            raise ValueError("must be a number other than 0")
        return scale


class Cable(Part):
    """One cable, from its anchor on a carrier to its attachment on the platform. It pulls and never pushes."""

    carrier: Name = Field(description="name of the carrier that holds its anchor")
    anchor: Vector3 = Field(description="A_i in the carrier frame [m]")
    attachment: Vector3 = Field(description="B_i in the platform frame [m]")
    t_min: NonNegative = Field(description="smallest tension [N]; above zero keeps the cable taut")
    t_max: Positive = Field(description="largest tension [N]")
    stiffness: Positive | None = Field(default=None, description="E A [N]; default: the cable does not stretch")
    damping: NonNegative | None = Field(default=None, description="C [N s/m]")
    length: Positive | None = Field(
        default=None,
        description="[m], where the drive is fixed-length; default there: from anchor to attachment at home",
    )
    pulley: Pulley | None = Field(default=None, description="default: the anchor is a point")
    winch: Winch | None = Field(
        default=None, description="what moves the cable, for simulation; default: its length follows commands exactly"
    )
    encoder: Encoder | None = Field(
        default=None, description="what the winch reports, for calibration; default: the length itself [m]"
    )

    @model_validator(mode="after")
    def _limits_in_order(self) -> Self:
        if self.t_min > self.t_max:
            raise ValueError(f"t_min must not exceed t_max, {self.t_max:g} N, got {self.t_min:g} N")
        return self


def _without_default(schema: dict[str, Any]) -> None:
    """Remove a default that stands for one that depends on other fields."""
    del schema["default"]


class Robot(DisplayedRobot):
    """A cable robot: one platform, carriers, cables. Frozen; built by `load` or by `Robot.model_validate`.

    The arrays below are what computations read; each has one row per cable or carrier, in the order of the file.
    """

    name: Name
    source: str = Field(min_length=1, description="where the numbers come from, and which are assumed")
    gravity: Vector3 = Field(default=(0.0, 0.0, -9.81), description="in {G} [m/s^2]")
    drive: Drive = Field(
        default=cast(Any, None),
        json_schema_extra=_without_default,
        description="what moves (paper C). fixed-length: the carriers, each cable keeps its length; "
        "variable-length: the winches, mobile carriers stay at home; both: carriers and winches. Default: fixed-length "
        "if all cables hang from quadrotors or mobile carriers and none has a winch, an encoder or a pulley; else both",
    )
    platform: Platform
    carriers: tuple[AnyCarrier, ...] = Field(min_length=1)
    cables: tuple[Cable, ...] = Field(min_length=1)
    uncertainty: Uncertainty | None = Field(
        default=None, description="how well numbers of the cables are known; default: they count as exact"
    )

    @model_validator(mode="after")
    def _parts_fit(self) -> Self:
        names = [carrier.name for carrier in self.carriers]
        for index, name in enumerate(names):
            if name == "world":
                raise ValueError(f"carriers[{index}].name must not be 'world', which means the global frame")
            if name in names[:index]:
                raise ValueError(f"carriers[{index}].name must be unique, got {name!r} twice")
        for index, cable in enumerate(self.cables):
            if cable.carrier not in names:
                raise ValueError(f"cables[{index}].carrier must be one of {', '.join(names)}, got {cable.carrier!r}")
        lengths = np.linalg.norm(self.home_anchors - self.home_attachments, axis=1)
        if (self.drive or usual_drive(self)) == "fixed-length":
            object.__setattr__(self, "cables", lengths_to_keep(self, lengths))
        object.__setattr__(self, "drive", self.drive or usual_drive(self))
        shortest = int(np.argmin(lengths))
        if not lengths[shortest] > 1e-9:
            raise ValueError(
                f"cables[{shortest}] must have a length > 0 m at home, got an anchor and an attachment that coincide"
            )
        if self.pulley_radii.any():
            check_pulleys(self)
        for index, name in enumerate(self.uncertainty.parameters if self.uncertainty else ()):
            try:
                parameters.locate(name, self.cables)
            except ValueError as error:
                raise ValueError(f"uncertainty.parameters[{index}] {error}") from None
        return self

    def parameter_values(self, names: Iterable[str]) -> np.ndarray:
        """Return numbers of the cables by name, as `cables[2].anchor.x` or `cables[2].pulley.radius`, (p,) [m].

        Raises
        ------
        InputError
            If `names` is no list of names, or the robot has no such number.
        """
        return parameters.values(self, names)  # (p,)

    def with_parameters(self, values: Mapping[str, float]) -> Robot:
        """Return the robot with other numbers of its cables [m], by the names of `parameter_values`.

        Raises
        ------
        InputError
            If `values` is no mapping, the robot has no such number, or a value is not possible.
        """
        return Robot.model_validate(parameters.changed(self, values))

    def drawn(self, count: int, seed: int = 0) -> tuple[Robot, ...]:
        """Draw robots whose numbers differ from the file's as its `uncertainty` states; each one is known exactly.

        Parameters
        ----------
        count
            How many.
        seed
            Of the random numbers: the first robots are the same ones whatever the count.

        Raises
        ------
        InputError
            If the robot has no uncertainty, an argument is wrong, or so large an error is drawn that no robot has it.
        """
        return draw(self, count, seed)

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Save the robot as a robot file, whole or not at all; `load` reads an equal robot from it.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        from .parsing import save_yaml

        return save_yaml(self, file)

    @property
    def m(self) -> int:
        """Return the number of cables."""
        return len(self.cables)

    @property
    def anchors(self) -> np.ndarray:
        """Return the anchors A_i, each in the frame of its carrier, (m, 3) [m]."""
        return np.array([cable.anchor for cable in self.cables])  # (m, 3)

    @property
    def attachments(self) -> np.ndarray:
        """Return the attachments B_i in the platform frame, (m, 3) [m]."""
        return np.array([cable.attachment for cable in self.cables])  # (m, 3)

    @property
    def pulley_radii(self) -> np.ndarray:
        """Return the radius of each cable's pulley, (m,) [m], 0 for a point anchor."""
        return np.array([cable.pulley.radius if cable.pulley else 0.0 for cable in self.cables])  # (m,)

    @property
    def pulley_axes(self) -> np.ndarray:
        """Return the swivel axis of each cable's pulley in its carrier's frame, (m, 3) [-]; z for a point anchor."""
        axes = np.array([cable.pulley.axis if cable.pulley else (0.0, 0.0, 1.0) for cable in self.cables])
        return axes / np.linalg.norm(axes, axis=1, keepdims=True)  # (m, 3)

    @property
    def carrier_of_cable(self) -> np.ndarray:
        """Return the index of the carrier of each cable, (m,)."""
        names = [carrier.name for carrier in self.carriers]
        return np.array([names.index(cable.carrier) for cable in self.cables])  # (m,)

    @property
    def t_min(self) -> np.ndarray:
        """Return the smallest tensions, (m,) [N]."""
        return np.array([cable.t_min for cable in self.cables])  # (m,)

    @property
    def t_max(self) -> np.ndarray:
        """Return the largest tensions, (m,) [N]."""
        return np.array([cable.t_max for cable in self.cables])  # (m,)

    @property
    def fixed_lengths(self) -> np.ndarray | None:
        """Return the lengths that the drive keeps, (m,) [m], or None if winches change them."""
        if self.drive != "fixed-length":
            return None
        return np.array([cable.length for cable in self.cables], dtype=float)

    @property
    def carrier_home(self) -> np.ndarray:
        """Return the home poses of the carriers in {G}, (c, 6) [m, rad]."""
        return np.array([carrier.home for carrier in self.carriers])  # (c, 6)

    @property
    def carrier_radius(self) -> np.ndarray:
        """Return the radii of the balls about the carriers' origins that hold their bodies, (c,) [m]; 0: a point."""
        anchors, owner = self.anchors, self.carrier_of_cable
        return np.array([each.body_radius(anchors[owner == i]) for i, each in enumerate(self.carriers)])  # (c,)

    @property
    def home(self) -> np.ndarray:
        """Return the home pose of the platform in {G}, (6,) [m, rad]: the file's, or else amid or below the anchors."""
        return np.array(self.platform.home or points.default_home(self.home_anchors, self.attachments))  # (6,)

    @property
    def home_anchors(self) -> np.ndarray:
        """Return the anchors in {G} with the carriers at home, (m, 3) [m]."""
        return points.anchors(self, self.carrier_home)  # (m, 3)

    @property
    def home_attachments(self) -> np.ndarray:
        """Return the attachments in {G} with the platform at home, (m, 3) [m]."""
        return points.attachments(self, self.home)  # (m, 3)

    @property
    def home_com(self) -> np.ndarray:
        """Return the CoM in {G} with the platform at home, (3,) [m]."""
        return points.placed(self.home, np.array([self.platform.com]))[0]  # (3,)

    @property
    def inertia(self) -> np.ndarray:
        """Return the inertia matrix I_b about the CoM in platform axes, (3, 3) [kg m^2], or 0 without an inertia."""
        return inertia_matrix(self.platform.inertia or (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))  # (3, 3)

    @property
    def dof_mask(self) -> np.ndarray:
        """Return 1 for the wrench rows that the cables have to balance, 0 for coordinates that cannot move, (6,)."""
        return np.array([float(name in self.platform.dof) for name in COORDINATES])  # (6,)

    @property
    def weight(self) -> float:
        """Return the weight of the platform [N]."""
        return float(self.platform.mass * np.linalg.norm(self.gravity))

    @property
    def force_scale(self) -> float:
        """Return a force [N] as a scale for others: the weight, or without gravity the mean of the largest tensions."""
        return self.weight or float(self.t_max.mean())

    @property
    def wrench_scale(self) -> np.ndarray:
        """Return the factors that bring a wrench to newtons, (6,): 1 for forces [-], 1 / `length` for moments [1/m]."""
        return np.repeat([1.0, 1.0 / self.length], 3)  # (6,)

    @property
    def length(self) -> float:
        """Return the length that scales moments to forces [m]: the largest distance of an attachment from the CoM."""
        arms = np.linalg.norm(self.attachments - np.array(self.platform.com), axis=1)
        return float(arms.max()) if arms.max() > 0 else 1.0
