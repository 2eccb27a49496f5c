"""A robot as data: one platform, the carriers its cables hang from, and the cables. Only checks are computed.

SI units throughout: metres, kilograms, seconds, newtons, radians. {G} is the global frame (gravity says which way is
down), the platform frame sits on the platform, a carrier frame on each carrier. Poses are (x, y, z, roll, pitch, yaw)
with R = Rz(yaw) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

Finite = Annotated[float, Field(allow_inf_nan=False, strict=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Vector3 = tuple[Finite, Finite, Finite]
Pose = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
Inertia = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
Name = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]

AT_ORIGIN: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Part(BaseModel):
    """What all parts share: they do not change, and a key that is not theirs is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Aero(Part):
    """How the air pushes the platform (paper F, Eq. 25).

    The force acts at the CoM along the axes of {G}: along x and y with the drag coefficient, along z with the lift
    coefficient; V is the air's velocity relative to the platform.
    """

    air_density: Positive = Field(description="rho [kg/m^3]")
    drag: NonNegative = Field(description="drag coefficient C_d [-]")
    lift: NonNegative = Field(description="lift coefficient C_l [-]")
    area: Positive = Field(description="largest cross-section S of the platform [m^2]")
    form: Literal["signed", "printed"] = Field(
        default="signed", description="signed: V abs(V), as drag is; printed: V^2, never negative, as paper F has it"
    )


def _positive_definite(inertia: Inertia) -> Inertia:
    smallest = float(np.linalg.eigvalsh(inertia_matrix(inertia))[0])
    if not smallest > 0:
        raise ValueError(
            f"the inertia must be positive definite (all principal moments > 0 kg m^2), the smallest is {smallest:g}"
        )
    return inertia


class Platform(Part):
    """The rigid body that the cables pull."""

    mass: Positive = Field(description="[kg]")
    inertia: Annotated[Inertia, AfterValidator(_positive_definite)] = Field(
        description="(Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the CoM in platform axes, tensor signs [kg m^2]"
    )
    com: Vector3 = Field(default=(0.0, 0.0, 0.0), description="CoM in the platform frame [m]")
    home: Pose | None = Field(
        default=None,
        description="a pose in {G} to start from and to diagnose at [m, rad]; none: level, amid or below the anchors",
    )
    aero: Aero | None = Field(default=None, description="none: no wind force is known")


class Carrier(Part):
    """What anchors ride on. Its frame carries the anchors of its cables."""

    name: Name
    home: Pose = Field(default=AT_ORIGIN, description="pose of the carrier frame in {G} at rest [m, rad]")


class GroundCarrier(Carrier):
    """A frame on the ground: it never moves."""

    kind: Literal["ground"]


class PrescribedCarrier(Carrier):
    """A base whose motion is given from outside and disturbs the platform (paper F's quadrotor)."""

    kind: Literal["prescribed"]


class Box(Part):
    """A box along the axes of {G}, from its lowest to its highest corner [m]."""

    min: Vector3
    max: Vector3

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for axis, low, high in zip("xyz", self.min, self.max, strict=True):
            if low > high:
                raise ValueError(f"min must not exceed max, but along {axis} min is {low:g} and max is {high:g}")
        return self


class MobileCarrier(Carrier):
    """A robot-end that may be placed in a reach box (paper C): a point, so its orientation stays at home."""

    kind: Literal["mobile"]
    reach: Box = Field(description="where the carrier's origin may be, in {G} [m]")
    speed_max: Positive = Field(description="[m/s]")
    acceleration_max: Positive = Field(description="[m/s^2]")

    @model_validator(mode="after")
    def _home_in_reach(self) -> Self:
        for axis, low, at, high in zip("xyz", self.reach.min, self.home[:3], self.reach.max, strict=True):
            if not low <= at <= high:
                raise ValueError(f"home must lie in reach, but along {axis} {at:g} is not in [{low:g}, {high:g}]")
        return self


AnyCarrier = Annotated[GroundCarrier | PrescribedCarrier | MobileCarrier, Field(discriminator="kind")]


class Cable(Part):
    """One cable, from its anchor on a carrier to its attachment on the platform. It pulls and never pushes."""

    carrier: Name = Field(description="name of the carrier that it hangs from")
    anchor: Vector3 = Field(description="A_i in the carrier frame [m]")
    attachment: Vector3 = Field(description="B_i in the platform frame [m]")
    t_min: NonNegative = Field(description="smallest tension [N]; above zero keeps the cable taut")
    t_max: Positive = Field(description="largest tension [N]")
    stiffness: Positive | None = Field(default=None, description="E A [N]; none: the cable does not stretch")
    damping: NonNegative | None = Field(default=None, description="C [N s/m]")
    pulley: None = Field(default=None, description="null: the anchor is a point")

    @model_validator(mode="after")
    def _limits_in_order(self) -> Self:
        if self.t_min > self.t_max:
            raise ValueError(
                f"t_min must not exceed t_max, but t_min is {self.t_min:g} N and t_max is {self.t_max:g} N"
            )
        return self


class Robot(Part):
    """A cable robot: one platform, carriers, cables. Frozen; built by `load` or by `Robot.model_validate`.

    The arrays below are what computations read; each has one row per cable or carrier, in the order of the file.
    """

    name: Name
    source: str = Field(min_length=1, description="where the numbers come from, and which are assumed")
    gravity: Vector3 = Field(default=(0.0, 0.0, -9.81), description="in {G} [m/s^2]")
    platform: Platform
    carriers: tuple[AnyCarrier, ...] = Field(min_length=1)
    cables: tuple[Cable, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _parts_fit(self) -> Self:
        names = [carrier.name for carrier in self.carriers]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise ValueError(f"carriers[{index}].name: {name!r} is there twice, each carrier needs its own name")
        for index, cable in enumerate(self.cables):
            if cable.carrier not in names:
                raise ValueError(f"cables[{index}].carrier: {cable.carrier!r} is unknown, accepted: {', '.join(names)}")
        from . import kinematics  # CasADi is needed only once a whole robot stands

        attachments = kinematics.transform(kinematics.ca.DM(self.home), self.attachments).full().T
        lengths = np.linalg.norm(self.home_anchors - attachments, axis=1)
        shortest = int(np.argmin(lengths))
        if not lengths[shortest] > 1e-9:
            raise ValueError(
                f"cables[{shortest}]: its anchor and attachment coincide at home, a cable needs a length > 0 m"
            )
        return self

    @property
    def m(self) -> int:
        """Number of cables."""
        return len(self.cables)

    @property
    def anchors(self) -> np.ndarray:
        """Anchors A_i, each in the frame of its carrier [m]."""
        return np.array([cable.anchor for cable in self.cables])  # (m, 3)

    @property
    def attachments(self) -> np.ndarray:
        """Attachments B_i in the platform frame [m]."""
        return np.array([cable.attachment for cable in self.cables])  # (m, 3)

    @property
    def carrier_of_cable(self) -> np.ndarray:
        """Index of the carrier that each cable hangs from."""
        names = [carrier.name for carrier in self.carriers]
        return np.array([names.index(cable.carrier) for cable in self.cables])  # (m,)

    @property
    def t_min(self) -> np.ndarray:
        """Smallest tensions [N]."""
        return np.array([cable.t_min for cable in self.cables])  # (m,)

    @property
    def t_max(self) -> np.ndarray:
        """Largest tensions [N]."""
        return np.array([cable.t_max for cable in self.cables])  # (m,)

    @property
    def carrier_home(self) -> np.ndarray:
        """Home poses of the carriers in {G} [m, rad]."""
        return np.array([carrier.home for carrier in self.carriers])  # (c, 6)

    @property
    def home(self) -> np.ndarray:
        """Home pose of the platform in {G} [m, rad], from the file or, if it has none, amid or below the anchors."""
        if self.platform.home is not None:
            return np.array(self.platform.home)  # (6,)
        from . import kinematics

        return kinematics.default_home(self.home_anchors, self.attachments)

    @property
    def home_anchors(self) -> np.ndarray:
        """Anchors in {G} with the carriers at home [m]."""
        from . import kinematics

        at_home = kinematics.ca.DM(self.carrier_home)
        return kinematics.anchors(self.anchors, self.carrier_of_cable, at_home).full().T  # (m, 3)

    @property
    def inertia(self) -> np.ndarray:
        """Inertia matrix I_b about the CoM in platform axes [kg m^2]."""
        return inertia_matrix(self.platform.inertia)  # (3, 3)

    @property
    def weight(self) -> float:
        """Weight of the platform [N]."""
        return float(self.platform.mass * np.linalg.norm(self.gravity))

    @property
    def length(self) -> float:
        """Length that makes moments comparable to forces [m]: the largest distance of an attachment from the CoM."""
        arms = np.linalg.norm(self.attachments - np.array(self.platform.com), axis=1)
        return float(arms.max()) if arms.max() > 0 else 1.0


def inertia_matrix(inertia: Inertia) -> np.ndarray:
    """Symmetric matrix of (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) [kg m^2]."""
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])  # (3, 3)
