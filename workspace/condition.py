"""Conditions that make a place part of a workspace: `Condition`, and conditions joined by & and |.

A condition is data: it does not change, compares by value, and goes to JSON and back by its `kind`, so that it can be
written into a result, a checkpoint or a message to another machine.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import BeforeValidator, Field, SerializeAsAny

from ..base.errors import InputError
from ..base.inputs import number, required, shown
from ..models import Robot
from ..models.part import Part, Share
from .feasibility import too_few_cables
from .places import Places, check_places

LEAST_SHARE = 1e-9  # of robots that must fulfil a condition, or that need not


class Condition(Part, ABC):
    """A property of a place that holds or does not. A condition of your own has a `kind` and `evaluate`.

    Attributes
    ----------
    kinds
        The registry: every condition by its kind, from when its class is defined.
    takes_every_row
        Whether it takes a cable for each degree of freedom: with fewer it holds nowhere.
    """

    kinds: ClassVar[dict[str, type[Condition]]] = {}
    takes_every_row: ClassVar[bool] = False

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        super().__pydantic_init_subclass__(**options)
        if "kind" in cls.__annotations__:  # its own: a subclass that only inherits one does not replace its parent
            Condition.kinds[get_args(cls.model_fields["kind"].annotation)[0]] = cls

    def holds(self, robot: Robot, places: Places) -> np.ndarray:
        """Return where the condition holds among n places, (n,) of bool; False where a number is not finite.

        Raises
        ------
        InputError
            If an argument has a wrong type or shape, or the condition does not apply to the robot.
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
        """Return where the condition holds among places of finite numbers, (n,) of bool.

        Raises
        ------
        InputError
            If the condition does not apply to the robot.
        """

    def shortfall(self, robot: Robot, places: Places) -> np.ndarray:
        """Return how far each place is from fulfilling the condition, (n,): zero exactly where it holds.

        The number has a unit of the condition's own and falls towards the places that fulfil it, for searches; here it
        is 1 where the condition does not hold. Numbers of the places must be finite.
        """
        return np.where(self.holds(robot, places), 0.0, 1.0)

    def why_nowhere(self, robot: Robot) -> str | None:
        """Return why the condition holds nowhere, or at isolated poses only, whatever the region; None if it may."""
        return too_few_cables(robot) if self.takes_every_row else None

    def for_robots(self, robust: float) -> Condition:
        """Return the condition for a share `robust` of the robots of an uncertainty; without such a key it is the same.

        Raises
        ------
        InputError
            If `robust` is no number between 0 and 1.
        """
        share = number("robust", robust, LEAST_SHARE, 1 - LEAST_SHARE)
        return self.model_copy(update={"robust": share}) if "robust" in type(self).model_fields else self

    def __and__(self, other: Condition) -> AllOf:
        """Return the condition that both hold."""
        return AllOf(kind="all", conditions=(*_parts(self, AllOf), *_parts(other, AllOf)))

    def __or__(self, other: Condition) -> AnyOf:
        """Return the condition that at least one of the two holds."""
        return AnyOf(kind="any", conditions=(*_parts(self, AnyOf), *_parts(other, AnyOf)))


def condition_from(data: Any) -> Condition:
    """Make a condition from its data: a mapping, as `model_dump` returns it or as a file has it.

    Raises
    ------
    InputError
        If `kind` is missing or unknown, or another key does not fit.
    """
    if isinstance(data, Condition):
        return data
    accepted = ", ".join(sorted(Condition.kinds))
    if not isinstance(data, dict) or "kind" not in data:
        raise InputError(f"condition must be a mapping with a kind, one of {accepted}, got {shown(data)}")
    if not isinstance(data["kind"], str) or data["kind"] not in Condition.kinds:
        raise InputError(f"condition.kind must be one of {accepted}, got {shown(data['kind'])}")
    return Condition.kinds[data["kind"]](**{str(name): value for name, value in data.items()})


def for_robots(condition: Condition, share: float | None) -> Condition:
    """Return a condition for a share of the robots of an uncertainty, or as it is if `share` is None.

    Raises
    ------
    InputError
        If `share` is no number between 0 and 1, or no part of the condition is about tension limits.
    """
    if share is None:
        return condition
    changed = condition.for_robots(share)
    if changed == condition == condition.for_robots(share / 2):
        raise InputError(f"robust must be None for a condition without tension limits, got {shown(share)}")
    return changed


AnyCondition = Annotated[SerializeAsAny[Condition], BeforeValidator(condition_from)]


class TensionCondition(Condition, ABC):
    """A condition about tensions inside their limits, which can be required of the robots of an uncertainty."""

    robust: Share | None = Field(
        default=None,
        description="share of the robots of the robot's `uncertainty` for which the condition must hold, to first "
        "order, at all accepted places at once, such as 0.95; default: the robot is as its file has it",
    )


class AllOf(Condition):
    """All of some conditions hold. Each is evaluated only where those before it hold."""

    kind: Literal["all"] = "all"
    conditions: tuple[AnyCondition, ...] = Field(min_length=1, description="conditions that all must hold")

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        """Return where all hold, (n,) of bool."""
        return _one_by_one(self.conditions, robot, places, undecided=True)

    def for_robots(self, robust: float) -> Condition:
        """Return all conditions for a share `robust` of the robots."""
        return AllOf(conditions=tuple(one.for_robots(robust) for one in self.conditions))

    def shortfall(self, robot: Robot, places: Places) -> np.ndarray:
        """Return the sum of the shortfalls x, each as a share of 1: x / (1 + x)."""
        return np.sum([_share(one.shortfall(robot, places)) for one in self.conditions], axis=0)

    def why_nowhere(self, robot: Robot) -> str | None:
        """Return the reason of the first condition that has one."""
        return next((reason for one in self.conditions if (reason := one.why_nowhere(robot))), None)


class AnyOf(Condition):
    """At least one of some conditions holds. Each is evaluated only where none before it holds."""

    kind: Literal["any"] = "any"
    conditions: tuple[AnyCondition, ...] = Field(min_length=1, description="conditions of which one must hold")

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        """Return where one of them holds, (n,) of bool."""
        return _one_by_one(self.conditions, robot, places, undecided=False)

    def for_robots(self, robust: float) -> Condition:
        """Return the alternatives for a share `robust` of the robots."""
        return AnyOf(conditions=tuple(one.for_robots(robust) for one in self.conditions))

    def shortfall(self, robot: Robot, places: Places) -> np.ndarray:
        """Return the smallest of the shortfalls x, as a share of 1: x / (1 + x)."""
        return np.min([_share(one.shortfall(robot, places)) for one in self.conditions], axis=0)

    def why_nowhere(self, robot: Robot) -> str | None:
        """Return the first reason, if every condition has one."""
        reasons = [one.why_nowhere(robot) for one in self.conditions]
        return reasons[0] if all(reasons) else None


def _share(amount: np.ndarray) -> np.ndarray:
    return 1.0 - 1.0 / (1.0 + amount)


def _parts(condition: Condition, joined: type[AllOf] | type[AnyOf]) -> tuple[Condition, ...]:
    required("condition", condition, Condition)
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
