"""`Part`: the base of everything that a file describes, and the types of its fields, each with its unit checks.

SI units throughout: metres, kilograms, seconds, newtons, radians. Poses are (x, y, z, roll, pitch, yaw) with
R = Rz(yaw) Ry(pitch) Rx(roll).
"""

import re
from collections.abc import Iterable
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias, TypeVar

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator
from typing_extensions import override

from ..base.display import Displayed, Fact, brief
from ..base.inputs import MOST_ROWS, InputError

LARGEST = 1e9  # of any number in a file: beyond it squares and products stop being exact enough


def _plain_number(value: Any) -> Any:
    if isinstance(value, bool | str | complex):
        raise ValueError("must be a number")
    return value


# The bounds stand before the check, so that pydantic's core tests them and the JSON schema has them in its own words.
Finite = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False), BeforeValidator(_plain_number)]
Positive = Annotated[float, Field(gt=0, le=LARGEST, allow_inf_nan=False), BeforeValidator(_plain_number)]
NonNegative = Annotated[float, Field(ge=0, le=LARGEST, allow_inf_nan=False), BeforeValidator(_plain_number)]
Tilt = Annotated[float, Field(gt=0, le=np.pi, allow_inf_nan=False), BeforeValidator(_plain_number)]
Whole = Annotated[int, BeforeValidator(_plain_number)]
Share = Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False), BeforeValidator(_plain_number)]
Vector3 = tuple[Finite, Finite, Finite]
Pose = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
Inertia = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
Item = TypeVar("Item")
# A long list of rows of numbers. Its first wrong row is the only one reported: to collect all takes minutes.
Rows: TypeAlias = Annotated[tuple[Item, ...], Field(min_length=1, max_length=MOST_ROWS, fail_fast=True)]
Name = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
# What nothing else refers to by its name may have spaces in it.
Title = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9]([A-Za-z0-9_. -]*[A-Za-z0-9_.-])?$")]


def _check_direction(value: Vector3) -> Vector3:
    if not np.linalg.norm(value) > 0:
        raise ValueError("must be a direction other than zero")
    return value


Direction = Annotated[Vector3, AfterValidator(_check_direction)]
"""A direction, of any length."""
Coordinate = Literal["x", "y", "z", "roll", "pitch", "yaw"]
COORDINATES: tuple[Coordinate, ...] = ("x", "y", "z", "roll", "pitch", "yaw")

AT_ORIGIN: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def optional(description: str, default: Any = None, **constraints: Any) -> Any:
    """Return a field that may be left out. Keyword arguments as for pydantic's `Field`."""
    return Field(default=default, description=description, **constraints)


def _in_words(kind: type) -> str:
    """Return the name of a class as errors have it: "wrench-feasible"."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", kind.__name__).lower()


class Part(Displayed, BaseModel):
    """The base of all parts: they are frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)

    def __init__(self, /, **fields: Any):
        """Check the fields, with the errors of `model_validate`."""
        from .parsing import one_line

        try:
            super().__init__(**fields)
        except ValidationError as error:
            raise InputError(one_line(error, _in_words(type(self)), type(self))) from None

    # As of pydantic's own: parts inside of parts are checked without a call of it, so that errors keep their place.
    __init__.__pydantic_base_init__ = True  # pyrefly: ignore[missing-attribute]

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """Check a mapping as pydantic does, or raise InputError in one line: field, value and what is accepted."""
        from .parsing import one_line

        try:
            return super().model_validate(obj, **options)
        except ValidationError as error:
            raise InputError(one_line(error, _in_words(cls), cls)) from None

    @override
    def __str__(self) -> str:
        return repr(self)

    def _facts(self) -> Iterable[Fact]:
        """Return the fields that were given."""
        given = (name for name in type(self).model_fields if name in self.model_fields_set)
        return [(name, brief(getattr(self, name))) for name in given]

    @override
    def __eq__(self, other: object) -> bool:
        """Return whether the other is of the same class with equal fields, whatever either has computed from them."""
        if type(self) is not type(other):
            return NotImplemented
        # As lists, whose comparison takes no step of Python for numbers and shared parts.
        mine, its = ([vars(one)[name] for name in type(self).__pydantic_fields__] for one in (self, other))
        return mine == its


class Box(Part):
    """A box along the axes of {G}, from its lowest to its highest corner [m]."""

    sides: ClassVar[tuple[str, ...]] = ("along x", "along y", "along z")
    unit: ClassVar[str] = "m"  # boxes of other quantities are subclasses

    min: Vector3 = Field(description="lowest corner [m]")
    max: Vector3 = Field(description="highest corner [m]")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for side, low, high in zip(self.sides, self.min, self.max, strict=True):
            if low > high:
                raise ValueError(f"min must not exceed max, {high:g} {self.unit} {side}, got {low:g} {self.unit}")
        return self


class Range(Part):
    """The numbers from min to max, both included."""

    min: Finite = Field(description="smallest value")
    max: Finite = Field(description="largest value")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.min > self.max:
            raise ValueError(f"min must be at most max ({self.max:g}), got {self.min:g}")
        return self


class PositiveRange(Range):
    """The positive numbers from min to max, both included."""

    min: Positive = Field(description="smallest value, positive")
    max: Positive = Field(description="largest value, positive")


def inertia_matrix(inertia: Inertia) -> np.ndarray:
    """Return the symmetric matrix of (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) [kg m^2]."""
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])  # (3, 3)


def _check_positive_definite(inertia: Inertia) -> Inertia:
    smallest = float(np.linalg.eigvalsh(inertia_matrix(inertia))[0])
    if not smallest > 0:
        raise ValueError(
            f"must be positive definite (all principal moments > 0 kg m^2; the smallest moment is {smallest:g})"
        )
    return inertia


BodyInertia = Annotated[Inertia, AfterValidator(_check_positive_definite)]
