"""What makes a place part of a workspace: `Condition`, and conditions joined by & and |.

A condition is data: it does not change, compares by value, and goes to JSON and back by its `kind`, so that it can be
written into a result, a checkpoint or a message to another machine.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import BeforeValidator, Field, SerializeAsAny, ValidationError

from ..errors import InputError
from ..models import Robot
from ..models.parsing import one_line
from ..models.robot import Part
from .places import Places

__all__ = ["AllOf", "AnyOf", "Condition", "condition_from"]


class Condition(Part, ABC):
    """A question about a place that has the answer yes or no. A condition of your own has a `kind` and `_holds`."""

    kinds: ClassVar[dict[str, type[Condition]]] = {}

    def __init__(self, /, **fields: Any):
        try:
            super().__init__(**fields)
        except ValidationError as error:
            raise InputError(one_line(error, type(self).__name__, type(self))) from None

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        super().__pydantic_init_subclass__(**options)
        if "kind" in cls.__annotations__:  # its own: a subclass that only inherits one does not take its parent's place
            Condition.kinds[get_args(cls.model_fields["kind"].annotation)[0]] = cls

    def holds(self, robot: Robot, places: Places) -> np.ndarray:
        """Whether the condition holds at each of n places, (n,) of bool; False where a number of one is not finite.

        Raises
        ------
        InputError
            If the robot is none that the condition can be asked about.
        """
        finite = np.all(np.isfinite(places.pose), axis=1) & np.all(np.isfinite(places.carriers), axis=(1, 2))
        if finite.all():
            return self._holds(robot, places)
        held = np.zeros(len(places), dtype=bool)
        held[finite] = self._holds(robot, places.only(finite))
        return held

    @abstractmethod
    def _holds(self, robot: Robot, places: Places) -> np.ndarray:
        """Answer for places of finite numbers, (n,) of bool."""

    def lacks(self, robot: Robot, places: Places) -> np.ndarray:
        """How much is missing, (n,): zero exactly where the condition holds, a slope towards it for those who search.

        In a unit of the condition's own; here 1 where it does not hold. Numbers of the places have to be finite.
        """
        return np.where(self.holds(robot, places), 0.0, 1.0)

    def __and__(self, other: Condition) -> AllOf:
        """Both hold."""
        return AllOf(kind="all", conditions=(*_parts(self, AllOf), *_parts(other, AllOf)))

    def __or__(self, other: Condition) -> AnyOf:
        """At least one holds."""
        return AnyOf(kind="any", conditions=(*_parts(self, AnyOf), *_parts(other, AnyOf)))


def condition_from(data: Any) -> Condition:
    """A condition from its data: a mapping, as `model_dump` makes it or as a file has it.

    Raises
    ------
    InputError
        If `kind` is missing or unknown, or another key does not fit.
    """
    if isinstance(data, Condition):
        return data
    accepted = ", ".join(sorted(Condition.kinds))
    if not isinstance(data, dict) or "kind" not in data:
        raise InputError(f"condition: is {data!r}; accepted: a mapping with a kind, one of {accepted}")
    if not isinstance(data["kind"], str) or data["kind"] not in Condition.kinds:
        raise InputError(f"condition.kind: {data['kind']!r} is unknown; accepted: {accepted}")
    return Condition.kinds[data["kind"]](**{str(name): value for name, value in data.items()})


AnyCondition = Annotated[SerializeAsAny[Condition], BeforeValidator(condition_from)]


class AllOf(Condition):
    """All of some conditions hold. They are asked in their order, each only where those before it hold."""

    kind: Literal["all"] = "all"
    conditions: tuple[AnyCondition, ...] = Field(min_length=1)

    def _holds(self, robot: Robot, places: Places) -> np.ndarray:
        return _one_by_one(self.conditions, robot, places, undecided=True)

    def lacks(self, robot: Robot, places: Places) -> np.ndarray:
        """The sum of what each lacks, each as a share of 1: x / (1 + x)."""
        return np.sum([_share(one.lacks(robot, places)) for one in self.conditions], axis=0)


class AnyOf(Condition):
    """At least one of some conditions holds. They are asked in their order, each only where none before it holds."""

    kind: Literal["any"] = "any"
    conditions: tuple[AnyCondition, ...] = Field(min_length=1)

    def _holds(self, robot: Robot, places: Places) -> np.ndarray:
        return _one_by_one(self.conditions, robot, places, undecided=False)

    def lacks(self, robot: Robot, places: Places) -> np.ndarray:
        """What that one lacks which lacks least, as a share of 1: x / (1 + x)."""
        return np.min([_share(one.lacks(robot, places)) for one in self.conditions], axis=0)


def _share(amount: np.ndarray) -> np.ndarray:
    return 1.0 - 1.0 / (1.0 + amount)


def _parts(condition: Condition, joined: type[AllOf] | type[AnyOf]) -> tuple[Condition, ...]:
    return condition.conditions if isinstance(condition, joined) else (condition,)


def _one_by_one(conditions: tuple[Condition, ...], robot: Robot, places: Places, undecided: bool) -> np.ndarray:
    held = np.full(len(places), undecided)
    rows = np.arange(len(places))
    for condition in conditions:
        if not rows.size:
            break
        some = places if rows.size == len(places) else places.only(rows)
        held[rows] = condition.holds(robot, some)
        rows = np.flatnonzero(held == undecided)
    return held
