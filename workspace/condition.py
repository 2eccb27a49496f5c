"""Conditions on configurations: `Condition`, and conditions joined by & and |.

A condition is data: it is immutable, compares by value, and is converted to JSON and back by its `kind`, so that it can
be written into a result, a checkpoint or a message to another machine.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import BeforeValidator, Field, SerializeAsAny

from ..base.inputs import InputError, number, required, shown
from ..models import Robot
from ..models.parsing import validate
from ..models.part import Part, Share, optional
from .feasibility import too_few_cables
from .places import Places as Places, check_places as check_places  # for classes of conditions

LEAST_SHARE = 1e-9  # of robots that must fulfil a condition, or that need not


class Condition(Part, ABC):
    """A condition on configurations. A condition of your own defines `kind` and `evaluate`.

    Attributes:
        kinds: The registry: every defined condition by its kind.
        takes_every_row: True if it needs a cable for each degree of freedom: with fewer it holds nowhere.
    """

    kinds: ClassVar[dict[str, type[Condition]]] = {}
    takes_every_row: ClassVar[bool] = False

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        super().__pydantic_init_subclass__(**options)
        if "kind" in cls.__annotations__:  # its own: a subclass that only inherits one does not replace its parent
            Condition.kinds[get_args(cls.model_fields["kind"].annotation)[0]] = cls

    def holds(self, robot: Robot, places: Places) -> np.ndarray:
        """Return whether the condition holds at each of n configurations, (n,) of bool; False at one with nan or inf.

        Raises `InputError` if an argument has a wrong type or shape, or the condition does not apply to the robot.
        """
        check_places(robot, places)
        finite = np.all(np.isfinite(places.pose), axis=1) & np.all(np.isfinite(places.carriers), axis=(1, 2))
        if finite.all():
            return self.evaluate(robot, places)
        held = np.zeros(len(places), dtype=bool)
        held[finite] = self.evaluate(robot, places.only(finite))
        return held

    @abstractmethod
    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        """Return whether the condition holds at each configuration (finite numbers), (n,) of bool.

        Raises:
            InputError: If the condition does not apply to the robot.
        """

    def shortfall(self, robot: Robot, places: Places) -> np.ndarray:
        """Return a distance to fulfilment, (n,), zero exactly where the condition holds.

        It is in a unit of the condition's choice, and decreases towards fulfilment, so that searches can follow it. The
        default is 1 where the condition does not hold. The configurations must be finite.
        """
        return np.where(self.holds(robot, places), 0.0, 1.0)

    def why_nowhere(self, robot: Robot) -> str | None:
        """Return why the condition holds nowhere, or at isolated poses only, in any region; otherwise None."""
        return too_few_cables(robot) if self.takes_every_row else None

    def for_robots(self, robust: float) -> Condition:
        """Return the condition for a fraction `robust` of the uncertain robots; unchanged if it has no such key.

        Raises `InputError` if `robust` is not a number between 0 and 1.
        """
        share = number("robust", robust, LEAST_SHARE, 1 - LEAST_SHARE)
        return self.model_copy(update={"robust": share}) if "robust" in type(self).model_fields else self

    def __and__(self, other: Condition) -> AllOf:
        """Combine two conditions: both must hold."""
        return AllOf(kind="all", conditions=(*_parts(self, AllOf), *_parts(other, AllOf)))

    def __or__(self, other: Condition) -> AnyOf:
        """Combine two conditions: at least one must hold."""
        return AnyOf(kind="any", conditions=(*_parts(self, AnyOf), *_parts(other, AnyOf)))


def condition_from(data: Any) -> Condition:
    """Create a condition from its data: a mapping as returned by `model_dump` or read from a file.

    Raises:
        InputError: If `kind` is missing or unknown, or another key does not fit.
    """
    if isinstance(data, Condition):
        return data
    accepted = ", ".join(sorted(Condition.kinds))
    if not isinstance(data, dict) or "kind" not in data:
        raise InputError(f"condition must be a mapping with a kind, one of {accepted}, got {shown(data)}")
    if not isinstance(data["kind"], str) or data["kind"] not in Condition.kinds:
        raise InputError(f"condition.kind must be one of {accepted}, got {shown(data['kind'])}")
    fields = {str(name): value for name, value in data.items()}
    return validate(fields, Condition.kinds[data["kind"]], data["kind"])


def for_robots(condition: Condition, share: float | None) -> Condition:
    """Return a condition for a fraction of the uncertain robots, or unchanged if `share` is None.

    Raises `InputError` if `share` is not a number between 0 and 1, or no part of the condition is about tension
    limits.
    """
    if share is None:
        return condition
    changed = condition.for_robots(share)
    if changed == condition == condition.for_robots(share / 2):
        raise InputError(f"robust must be None for a condition without tension limits, got {shown(share)}")
    return changed


AnyCondition = Annotated[SerializeAsAny[Condition], BeforeValidator(condition_from)]


class TensionCondition(Condition, ABC):
    """A condition about tension limits, which can be required for uncertain robots."""

    robust: Share | None = optional(
        "fraction of all robots within the `uncertainty` of the robot file, such as 0.95, for which the "
        "condition must hold, to first order, at all accepted configurations simultaneously; default: the "
        "nominal robot only"
    )


class _Joined(Condition, ABC):
    """Conditions of which each is evaluated only where the previous ones do not decide."""

    every: ClassVar[bool]  # whether all have to hold, not only one

    conditions: tuple[AnyCondition, ...] = Field(min_length=1)

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        held = np.full(len(places), self.every)
        rows = np.arange(len(places))
        for condition in self.conditions:
            if not rows.size:
                break
            some = places if rows.size == len(places) else places.only(rows)
            held[rows] = condition.holds(robot, some)
            rows = np.flatnonzero(held == self.every)
        return held

    def for_robots(self, robust: float) -> Condition:
        """Return the joined conditions for a fraction `robust` of the robots."""
        return type(self)(conditions=tuple(one.for_robots(robust) for one in self.conditions))

    def shortfall(self, robot: Robot, places: Places) -> np.ndarray:
        """Return the sum of x / (1 + x) over the shortfalls x, each in its unit; of `AnyOf` the smallest of these."""
        shares = [1.0 - 1.0 / (1.0 + one.shortfall(robot, places)) for one in self.conditions]
        return (np.sum if self.every else np.min)(shares, axis=0)

    def why_nowhere(self, robot: Robot) -> str | None:
        """Return the first reason that a condition gives; of `AnyOf` only if every condition gives one."""
        reasons = [one.why_nowhere(robot) for one in self.conditions]
        return next(filter(None, reasons), None) if self.every or all(reasons) else None


class AllOf(_Joined):
    """All conditions hold. Each is evaluated only where the previous ones hold."""

    every: ClassVar[bool] = True

    kind: Literal["all"] = "all"
    conditions: tuple[AnyCondition, ...] = Field(min_length=1, description="conditions that must all hold")


class AnyOf(_Joined):
    """At least one condition holds. Each is evaluated only where no previous one holds."""

    every: ClassVar[bool] = False

    kind: Literal["any"] = "any"
    conditions: tuple[AnyCondition, ...] = Field(min_length=1, description="conditions of which one must hold")


def _parts(condition: Condition, joined: type[AllOf] | type[AnyOf]) -> tuple[Condition, ...]:
    required("condition", condition, Condition)
    return condition.conditions if isinstance(condition, joined) else (condition,)
