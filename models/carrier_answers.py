"""Data with which a carrier describes itself: its limits, its body, its actuators and efforts, and how it is drawn."""

from typing import NamedTuple

from .part import Box, Inertia
from .rotation import Matrix


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
    """An effort that a motion requires of a carrier, with the range that it has."""

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
