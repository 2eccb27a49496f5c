"""The platform of a robot as data: its mass, its aerodynamics and the coordinates in which it moves."""

from typing import Literal, Self

from pydantic import Field, field_validator, model_validator

from .part import COORDINATES, BodyInertia, Coordinate, NonNegative, Part, Pose, Positive, Vector3, optional
from .shapes import AnyBody

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
    """The force of the air on the platform: Eq. 25 of paper F (see docs/theory.md).

    The force acts at the CoM along the axes of {G}: along x and y with the drag coefficient, along z with the lift
    coefficient; V is the air's velocity relative to the platform.
    """

    air_density: Positive = Field(description="density rho [kg/m^3]")
    drag: NonNegative = Field(description="drag coefficient C_d [-]")
    lift: NonNegative = Field(description="lift coefficient C_l [-]")
    area: Positive = Field(description="largest cross-section S of the platform [m^2]")
    form: Literal["signed", "printed"] = optional(
        "signed: V abs(V), the direction of real drag; printed: V^2, never negative, as in paper F", "signed"
    )


class Platform(Part):
    """The rigid body that the cables pull."""

    mass: Positive = Field(description="mass [kg]")
    inertia: BodyInertia | None = optional(
        "inertia (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the CoM in platform axes [kg m^2], as entries of the tensor, so "
        "Ixy is minus the integral of x y dm; required unless the platform cannot turn"
    )
    com: Vector3 = optional("CoM in the platform frame [m]", (0.0, 0.0, 0.0))
    home: Pose | None = optional(
        "initial and reference pose in {G} [m, rad]; default: level, between or below the anchors"
    )
    dof: tuple[Coordinate, ...] = optional(
        "coordinates that can move; a point mass has x, y, z. The cables balance the wrench only in these",
        COORDINATES,
        min_length=1,
    )
    body: AnyBody | None = optional(
        "convex body in the platform frame, which plans keep above the floor, inside the workspace box and out "
        "of keep-out regions; default: the CoM and the attachments"
    )
    aero: Aero | None = optional("aerodynamic data of the platform; required for wind")

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
