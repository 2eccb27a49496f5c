"""Carriers: the bodies that hold the anchors of cables, one class for each type.

No other file depends on the type of a carrier. A new type is a subclass of `Carrier` with a field `kind`: robots and
robot files accept it as soon as the class is defined. Coordinates are numbered as in a pose: 0 to 5 are x, y, z, roll,
pitch and yaw.
"""

from functools import lru_cache, reduce
from operator import or_
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, get_args

import numpy as np
from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter, model_validator
from pydantic_core import CoreSchema, core_schema

from ..base.errors import InputError
from .arrays import Matrix
from .parsing import json_schema
from .part import (
    AT_ORIGIN,
    BodyInertia,
    Box as Box,  # these three also for carriers of users' own
    Finite as Finite,
    Inertia,
    Name,
    NonNegative,
    Part,
    Pose,
    Positive as Positive,
    inertia_matrix,
    optional,
)

Drive = Literal["both", "fixed-length", "variable-length"]
USUAL_RADIUS = 0.3  # [m] of a quadrotor of 1 kg
POSITION, TILT, YAW = (0, 1, 2), (3, 4), (5,)


class MotionLimits(NamedTuple):
    """The limits of a carrier's own motion; default: no limit."""

    speed: float | None = None  # [m/s]
    acceleration: float | None = None  # [m/s^2]
    tilt: float | None = None  # of its z axis to the vertical [rad]
    reach: Box | None = None  # where its origin may be, in {G} [m]


class RigidBody(NamedTuple):
    """The mass of a body [kg], and its inertia (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the CoM in its axes [kg m^2]."""

    mass: float
    inertia: Inertia


class Actuator(NamedTuple):
    """An actuator of a carrier: force [N] and moment [N m] for each unit of its command, in the carrier's axes."""

    name: str
    wrench: tuple[float, ...]  # (6,)
    low: float  # of the command
    high: float


class Effort(NamedTuple):
    """An effort that a motion requires of a carrier, with its limits."""

    name: str
    unit: str
    values: Matrix  # (k, 1)
    low: float
    high: float
    axes: tuple[str, ...] = ("",)  # (k,) names of the values, if there are several
    scale: float | None = None  # a typical size; default: the robot's scale of forces


class Drawing(NamedTuple):
    """Describe what figures and viewer draw of a carrier besides its anchors."""

    body: bool  # at its pose, with its name and path
    axes: bool  # of its frame, since it turns
    boxes: tuple[Box, ...]  # around it in {G} [m]
    rotors: bool = False  # four, as far from its origin as its body reaches


class Carrier(Part):
    """A body that holds anchors. The anchors of its cables are fixed in its frame.

    This base describes a carrier that never moves. Subclasses override the members that differ.
    """

    tows: ClassVar[bool] = False  # by cables without winches, unless the robot's file has winches or states its drive
    efforts: ClassVar[tuple[str, ...]] = ()  # names of what must hold it, against gravity and the pull of its cables
    coordinates: ClassVar[tuple[int, ...]] = ()  # in which it can move with every drive

    name: Name = Field(description="name by which cables and tasks refer to the carrier")
    home: Pose = optional("pose of the carrier frame in {G} at rest [m, rad]", AT_ORIGIN)
    kind: Any  # a Literal in each class

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        """Register the subclass by its kind."""
        super().__pydantic_init_subclass__(**options)
        for kind in get_args(cls.model_fields["kind"].annotation):
            known = _KINDS.get(kind, cls)
            if (known.__module__, known.__qualname__) != (cls.__module__, cls.__qualname__):
                raise InputError(f"kind must differ from the kind of {known.__name__}, got {kind!r} for {cls.__name__}")
            _KINDS[kind] = cls
            json_schema.cache_clear()

    def free_coordinates(self, drive: Drive) -> tuple[int, ...]:
        """Return the coordinates in which it can move with a drive of the robot; the others stay at home."""
        return self.coordinates

    def planned_coordinates(self, drive: Drive, tilts: bool = True) -> tuple[int, ...]:
        """Return the free coordinates that a planner chooses: no yaw, and no roll and pitch without `tilts`."""
        return tuple(i for i in self.free_coordinates(drive) if i in POSITION or (tilts and i in TILT))

    @property
    def moves(self) -> bool:
        """Return whether it can move at all, with some drive."""
        return bool(self.free_coordinates("both"))

    @property
    def keeps_attitude(self) -> bool:
        """Return whether it never turns."""
        return all(i in POSITION for i in self.free_coordinates("both"))

    @property
    def motion_limits(self) -> MotionLimits:
        """Return the limits of its own motion."""
        return MotionLimits()

    @property
    def confined(self) -> bool:
        """Return whether the carrier's position is bounded."""
        return not self.moves or self.motion_limits.reach is not None

    @property
    def body(self) -> RigidBody | None:
        """Return mass and inertia if forces determine its motion, or None if its motion is imposed on it."""
        return None

    def body_radius(self, anchors: np.ndarray) -> float:
        """Return the radius [m] of the ball about its origin that contains its body, with anchors (k, 3) [m].

        This is its default clearance from keep-out regions, and its size in figures, films and the viewer.
        """
        return 0.0

    @property
    def actuators(self) -> tuple[Actuator, ...]:
        """Return the actuators that move its body."""
        return ()

    @property
    def force_max(self) -> float:
        """Return the largest force that its actuators give together [N]."""
        return float(sum(max(-one.low, one.high) * np.linalg.norm(one.wrench[:3]) for one in self.actuators))

    def imposed(self) -> "Carrier":
        """Return a carrier in its place whose motion is imposed, or itself if it never moves."""
        return PrescribedCarrier(name=self.name, home=self.home, kind="prescribed") if self.moves else self

    def required_effort(
        self, pose: Matrix, velocity: Matrix, acceleration: Matrix, pull: Matrix, gravity: np.ndarray
    ) -> tuple[Effort, ...]:
        """Return the efforts that a motion requires of it; none if its motion is imposed.

        - `pose`, `velocity`, `acceleration`: (6, 1) each, of its frame in {G}.
        - `pull`: force in {G} [N] and moment about its CoM in its own axes [N m] of its cables, (6, 1).
        - `gravity`: (3,) in {G} [m/s^2].
        """
        return ()

    def acceleration(
        self, pose: Matrix, velocity: Matrix, thrust: Matrix, torque: Matrix, pull: Matrix, gravity: np.ndarray
    ) -> Matrix | None:
        """Return the acceleration of its pose, (6, 1), or None if it is imposed; arguments as in `required_effort`.

        It results from `thrust` (1, 1) along its z axis [N], `torque` (3, 1) about its axes [N m], `pull` and
        gravity.
        """
        return None

    def balanced_tilt(
        self, pose: np.ndarray, acceleration: np.ndarray, pull: np.ndarray, gravity: np.ndarray
    ) -> np.ndarray | None:
        """Return roll and pitch, (n, 2) [rad], with which its efforts balance a motion, or None if any tilt does.

        - `pose`, `acceleration`: (n, 6) each, of its frame in {G}.
        - `pull`: force of its cables in {G}, (n, 3) [N].
        - `gravity`: (3,) in {G} [m/s^2].
        """
        return None

    @property
    def drawing(self) -> Drawing:
        """Return its drawing for figures and viewer."""
        reach = self.motion_limits.reach
        return Drawing(self.moves, not self.keeps_attitude, () if reach is None else (reach,))


_KINDS: dict[str, type[Carrier]] = {}  # by the value of the field `kind`


class GroundCarrier(Carrier):
    """A frame on the ground: it never moves."""

    kind: Literal["ground"]


class PrescribedCarrier(Carrier):
    """A carrier that follows a given or planned motion exactly, however hard its cables pull."""

    coordinates: ClassVar[tuple[int, ...]] = (*POSITION, *TILT, *YAW)

    kind: Literal["prescribed"]


class MobileCarrier(Carrier):
    """The end of a robot: a point that moves inside a reach box and keeps the orientation of its home."""

    tows: ClassVar[bool] = True

    kind: Literal["mobile"]
    reach: Box = Field(description="box of positions of the carrier's origin, in {G} [m]")
    speed_max: Positive = Field(description="largest speed [m/s]")
    acceleration_max: Positive = Field(description="largest acceleration [m/s^2]")

    @model_validator(mode="after")
    def _home_in_reach(self) -> Self:
        for axis, low, at, high in zip("xyz", self.reach.min, self.home[:3], self.reach.max, strict=True):
            if not low <= at <= high:
                raise ValueError(f"home must lie in reach, from {low:g} m to {high:g} m along {axis}, got {at:g} m")
        return self

    def free_coordinates(self, drive: Drive) -> tuple[int, ...]:
        """Return the axes along which the reach box is not flat; none if winches alone move the platform."""
        low, high = self.reach.min, self.reach.max
        return () if drive == "variable-length" else tuple(axis for axis in POSITION if low[axis] < high[axis])

    @property
    def motion_limits(self) -> MotionLimits:
        """Return the limits of the file."""
        return MotionLimits(speed=self.speed_max, acceleration=self.acceleration_max, reach=self.reach)


class QuadrotorCarrier(Carrier):
    """A rigid body that flies by thrust along its z axis and torques about its axes.

    Its frame has its origin at the CoM. Its motion follows from thrust, torque, weight and the pull of its cables.
    """

    # With thrust f, torque tau and the pull (F, M) of its cables, F in {G}, M in its own axes:
    # m (ddx - g) = f R e_z + F, and in its own axes I alpha + omega x I omega = tau + M.

    tows: ClassVar[bool] = True
    efforts: ClassVar[tuple[str, ...]] = ("thrust", "torque", "force perpendicular to the thrust")
    coordinates: ClassVar[tuple[int, ...]] = (*POSITION, *TILT, *YAW)

    kind: Literal["quadrotor"]
    mass: Positive = Field(description="mass [kg]")
    inertia: BodyInertia = Field(description="inertia (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the CoM [kg m^2]")
    thrust_min: NonNegative = optional("smallest total thrust [N]", 0.0)
    thrust_max: Positive = Field(description="largest total thrust [N]")
    torque_max: tuple[Positive, Positive, Positive] = Field(description="largest torque about each axis [N m]")
    tilt_max: Positive = optional("largest angle between its z axis and the vertical in plans [rad]", 0.6, lt=1.5)
    speed_max: Positive = optional("largest speed in plans [m/s]", 10.0)
    acceleration_max: Positive = optional("largest acceleration in plans [m/s^2]", 10.0)
    radius: Positive | None = optional(
        "radius of the ball about its CoM that contains its rotors [m]; default: 0.3 m times the square "
        "root of its mass in kg (common disc loading), but at least the distance of its anchors from its "
        "z axis"
    )

    @model_validator(mode="after")
    def _thrusts_in_order(self) -> Self:
        if self.thrust_min >= self.thrust_max:
            raise ValueError(f"thrust_min must be below thrust_max, {self.thrust_max:g} N, got {self.thrust_min:g} N")
        return self

    def planned_coordinates(self, drive: Drive, tilts: bool = True) -> tuple[int, ...]:
        """Return position and tilt: it tilts in every task, since its thrust must point along the force it gives."""
        return (*POSITION, *TILT)

    @property
    def motion_limits(self) -> MotionLimits:
        """Return the limits of the file."""
        return MotionLimits(speed=self.speed_max, acceleration=self.acceleration_max, tilt=self.tilt_max)

    @property
    def body(self) -> RigidBody:
        """Return mass and inertia of the file."""
        return RigidBody(self.mass, self.inertia)

    @property
    def actuators(self) -> tuple[Actuator, ...]:
        """Return its thrust, and a torque about each axis."""
        turning = [tuple(float(i == 3 + axis) for i in range(6)) for axis in range(3)]
        return (
            Actuator("thrust", (0.0, 0.0, 1.0, 0.0, 0.0, 0.0), self.thrust_min, self.thrust_max),
            *(
                Actuator(f"torque {letter}", wrench, -most, most)
                for letter, wrench, most in zip("xyz", turning, self.torque_max, strict=True)
            ),
        )

    def body_radius(self, anchors: np.ndarray) -> float:
        """Return the radius of the file, or one that fits its mass and holds its anchors."""
        if self.radius is not None:
            return self.radius
        return float(max(USUAL_RADIUS * np.sqrt(self.mass), *np.hypot(anchors[:, 0], anchors[:, 1]), 0.0))

    @property
    def drawing(self) -> Drawing:
        """Return its axes and four rotors."""
        return super().drawing._replace(rotors=True)

    def required_effort(
        self, pose: Matrix, velocity: Matrix, acceleration: Matrix, pull: Matrix, gravity: np.ndarray
    ) -> tuple[Effort, ...]:
        """Return thrust and torque, and the force perpendicular to the thrust, which it cannot give."""
        import casadi as ca  # as below: robots are read without it, faster

        from .rotation import turning

        (R, Omega, alpha), inertia = turning(pose, velocity, acceleration), ca.DM(inertia_matrix(self.inertia))
        force = R.T @ (self.mass * (acceleration[:3] - ca.DM(gravity)) - pull[:3])
        torque = inertia @ alpha + ca.cross(Omega, inertia @ Omega) - pull[3:6]
        return (
            Effort("thrust", "N", force[2], self.thrust_min, self.thrust_max, scale=self.thrust_max),
            Effort("force perpendicular to the thrust", "N", force[:2], 0.0, 0.0, ("x", "y")),
            *(
                Effort("torque", "N m", torque[axis], -most, most, ("xyz"[axis],), most)
                for axis, most in enumerate(self.torque_max)
            ),
        )

    def acceleration(
        self, pose: Matrix, velocity: Matrix, thrust: Matrix, torque: Matrix, pull: Matrix, gravity: np.ndarray
    ) -> Matrix:
        """Return the acceleration of its pose, (6, 1), that thrust [N] and torque [N m] give it."""
        import casadi as ca

        from .rotation import inverse_rate_matrix, rate_matrix, rate_matrix_derivative, rotation

        angles, rates, inertia = pose[3:6], velocity[3:6], inertia_matrix(self.inertia)
        linear = ca.DM(gravity) + (rotation(angles)[:, 2] * thrust + pull[0:3]) / self.mass
        Omega = rate_matrix(angles) @ rates
        alpha = ca.DM(np.linalg.inv(inertia)) @ (torque + pull[3:6] - ca.cross(Omega, ca.DM(inertia) @ Omega))
        angular = inverse_rate_matrix(angles) @ (alpha - rate_matrix_derivative(angles, rates) @ rates)
        return ca.vertcat(linear, angular)

    def balanced_tilt(
        self, pose: np.ndarray, acceleration: np.ndarray, pull: np.ndarray, gravity: np.ndarray
    ) -> np.ndarray:
        """Return roll r and pitch p, (n, 2) [rad], for which the z axis is along the force that it must give.

        At yaw zero that axis is (sin p cos r, -sin r, cos p cos r).
        """
        force, yaw = self.mass * (acceleration[:, :3] - gravity) - pull, pose[:, 5]
        x = np.cos(yaw) * force[:, 0] + np.sin(yaw) * force[:, 1]
        y = -np.sin(yaw) * force[:, 0] + np.cos(yaw) * force[:, 1]
        return np.stack([-np.arcsin(y / np.linalg.norm(force, axis=1)), np.arctan2(x, force[:, 2])], axis=1)


@lru_cache(maxsize=1)
def _adapter(classes: tuple[type[Carrier], ...]) -> TypeAdapter[Carrier]:
    """Return the check of a carrier of one of these classes, chosen by its kind."""
    one: Any = reduce(or_, classes)
    return TypeAdapter(Annotated[one, Field(discriminator="kind")])


def _known() -> TypeAdapter[Carrier]:
    return _adapter(tuple(_KINDS.values()))


class _ByKind:
    """The check of a carrier of any kind that is known when the check is made."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return a check that chooses the class by the kind."""
        return core_schema.no_info_plain_validator_function(lambda value: _known().validator.validate_python(value))

    def __get_pydantic_json_schema__(self, _: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return the alternatives, one a kind."""
        return handler(_known().core_schema)


AnyCarrier = Annotated[Carrier, _ByKind()]
