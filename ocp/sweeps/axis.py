"""`Axis`: one `Field` and the values that it takes in a sweep; from lists of values, or from the text of an option."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import chain
from math import prod
from typing import Any

import numpy as np

from ...base.display import Displayed
from ...base.inputs import InputError, shown
from ...models.parsing import parse_yaml
from ...models.part import Part

MOST_PLANS = 100_000
MOST_AXES, MOST_COLUMNS = 3, 6  # of a figure
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,2})?"
_RANGE = re.compile(rf"({_NUMBER}):({_NUMBER}):({_NUMBER})")
OF_ROBOT = "robot."  # begins the key of a field of the robot; a task has no field of that name
WHOLE = "robot", "task"  # keys whose values are whole robots or tasks, by name or file
_KEY = re.compile(r"[A-Za-z_][\w-]*(\[\d+\])*(\.[A-Za-z_][\w-]*(\[\d+\])*)*")
_STEP = re.compile(r"[^.\[\]]+")
_UNIT = re.compile(r"\[([^\]]+)\]")  # in the description of a field


@dataclass(frozen=True)
class Axis(Displayed):
    """A field and its values, as a task file has them."""

    field: Field
    values: tuple[Any, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Return the values as text: words as they are, all others as JSON."""
        return tuple(value if isinstance(value, str) else json.dumps(value) for value in self.values)

    @property
    def texts(self) -> tuple[str, ...]:
        """Return the values as text for people: numbers with at most ten digits."""
        pairs = zip(self.values, self.labels, strict=True)
        return tuple(f"{value:.10g}" if isinstance(value, float) else label for value, label in pairs)

    @property
    def numeric(self) -> bool:
        """Return whether all values are numbers."""
        return all(isinstance(value, float | int) and not isinstance(value, bool) for value in self.values)

    @property
    def coordinates(self) -> np.ndarray:
        """Return the values for a dataset, (n,): as numbers in the field's unit, or else as text."""
        return np.array(self.values, dtype=float) if self.numeric else np.array(self.labels)


def read_axes(vary: object) -> tuple[Axis, ...]:
    """Return the axes of a mapping from dotted keys to values.

    Raises `InputError` if it is anything else, a value appears twice, a key lies inside another one, or there are
    too many plans.
    """
    if not isinstance(vary, Mapping) or not vary:
        accepted = "a mapping from dotted keys of a task file to lists of values"
        raise InputError(f"vary must be {accepted}, got {shown(vary)}")
    axes: list[Axis] = []
    for key, values in vary.items():
        field = Field.of(key)
        for other in axes:
            if other.field.holds(field) or field.holds(other.field):
                raise InputError(f"vary must have keys of different fields, got {other.field.key} and {key}")
        axes.append(_axis(field, values))
    plans = prod(len(axis.values) for axis in axes)
    if plans > MOST_PLANS:
        raise InputError(f"vary must have at most {MOST_PLANS} combinations of values, got {plans}")
    return tuple(axes)


def _axis(field: Field, values: object) -> Axis:
    must = f"vary {field.key} must be a list of different values as in a task file, at least one"
    single = isinstance(values, str | bytes | Mapping | set) or (isinstance(values, np.ndarray) and not values.ndim)
    if single or not isinstance(values, Iterable):
        raise InputError(f"{must}, got {shown(values)}")
    plain = tuple(_plain(value) for value, _ in zip(values, range(MOST_PLANS + 1), strict=False))
    axis = Axis(field, plain)
    try:
        json.dumps(plain, allow_nan=False)
        coordinates = axis.coordinates.tolist()
    except (TypeError, ValueError, OverflowError, RecursionError):
        raise InputError(f"{must}, got values that no task file has, {shown(plain)}") from None
    twice = [value for value, count in Counter(coordinates).items() if count > 1]
    if twice or not plain:
        given = f"{axis.texts[coordinates.index(twice[0])]} twice" if twice else "none"
        raise InputError(f"{must}, got {given}")
    return axis


def _plain(value: Any) -> Any:
    """Return a value without types of NumPy, and tuples as lists."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


class _Values(Part):
    """The values of an option."""

    values: tuple[Any, ...]


def read_option(options: Sequence[str]) -> dict[str, list[Any]]:
    """Read texts such as "margin=0:20:5" as keys with their values.

    Values are separated by commas. Each is a range start:stop:step, with the stop if the steps meet it, or what a
    task file could have there: a number, a word, [a, list] or {a: mapping}. Raises `InputError` if a text has
    another form, or a key appears twice.
    """
    vary: dict[str, list[Any]] = {}
    for option in options:
        key, equals, text = option.partition("=")
        key = key.strip()
        if not equals or not key or not text.strip():
            accepted = "KEY=VALUES, such as margin=0:20:5 or scheme=linear,hermite"
            raise InputError(f"--vary must be {accepted}, got {shown(option)}")
        if key in vary:
            raise InputError(f"--vary must have keys of different fields, got {key} twice")
        try:
            values = parse_yaml(f"values: [{text}]", _Values, "").values
        except InputError:
            accepted = "values as in a task file, separated by commas, or ranges start:stop:step"
            raise InputError(f"--vary {key} must be {accepted}, got {shown(text)}") from None
        vary[key] = list(chain.from_iterable(_expanded(key, value) for value in values))
    return vary


def _expanded(key: str, value: Any) -> list[Any]:
    """Return the values of a range, or the value itself; steps are decimal, so that 0:1:0.1 has the number 0.3."""
    match = _RANGE.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        return [value]
    start, stop, step = map(Decimal, match.groups())
    whole = all(re.fullmatch(r"[-+]?\d+", number) for number in match.groups())
    steps = int((stop - start) / step) if step else -1
    if steps < 0 or (stop - start) * step < 0:
        raise InputError(f"--vary {key} must have ranges start:stop:step whose steps lead to stop, got {value!r}")
    if steps >= MOST_PLANS:
        raise InputError(f"--vary {key} must have at most {MOST_PLANS} values, got {steps + 1.0:.3g} of {value!r}")
    numbers = [start + index * step for index in range(steps + 1)]
    return [int(number) if whole else float(number) for number in numbers]


def check_figure(axes: Sequence[Axis]) -> None:
    """Check that a figure can show all varied fields.

    Raises `InputError` if there are too many, or too many values of the third.
    """
    if len(axes) > MOST_AXES:
        raise InputError(f"a figure must be of at most {MOST_AXES} varied fields, got {len(axes)}")
    if len(axes) == MOST_AXES and len(axes[-1].values) > MOST_COLUMNS:
        accepted = f"at most {MOST_COLUMNS} values of the third varied field"
        raise InputError(f"a figure must be of {accepted}, got {len(axes[-1].values)} of {axes[-1].field.key}")


@dataclass(frozen=True)
class Field(Displayed):
    """A field of a task, such as `tube.position`, or of the robot, such as `robot.platform.mass`.

    Items of lists have numbers from 0 on, as in `limits.keep_out[0].radius`; without a number all items are meant, as
    in `robot.cables.t_max`. `robot` and `task` are the whole of each.
    """

    key: str

    @classmethod
    def of(cls, key: object) -> Field:
        """Return the field of a key.

        Raises `InputError` if it is no dotted key.
        """
        if not isinstance(key, str) or not _KEY.fullmatch(key):
            accepted = "dotted keys of a task file, such as tube.position"
            raise InputError(f"vary must have {accepted}, got the key {shown(key)}")
        return cls(key)

    @property
    def of_robot(self) -> bool:
        """Return whether it is a field of the robot, and not of the task."""
        return self.key == "robot" or self.key.startswith(OF_ROBOT)

    @property
    def whole(self) -> bool:
        """Return whether its values are whole robots or tasks."""
        return self.key in WHOLE

    @property
    def name(self) -> str:
        """Return its name in tables: the varied `task.margin` is not the `margin` of a plan."""
        return self.key if self.of_robot or self.whole else f"task.{self.key}"

    @property
    def steps(self) -> tuple[str | int, ...]:
        """Return the keys and numbers that lead to it."""
        steps = _STEP.findall(self.key.removeprefix(OF_ROBOT))
        return tuple(int(step) if step.isdecimal() else step for step in steps)

    def holds(self, other: Field) -> bool:
        """Return whether the other field is this one or a part of it; of a whole robot or task fields can vary too."""
        if self.whole or other.whole:
            return self == other
        return other.steps[: len(self.steps)] == self.steps and other.of_robot == self.of_robot

    def set(self, data: Any, value: Any) -> Any:
        """Return data of a task or robot with another value of this field.

        Raises `InputError` if the data have no such place.
        """
        return self._set(data, self.steps, value, ())

    def _set(self, data: Any, left: tuple[str | int, ...], value: Any, done: tuple[str | int, ...]) -> Any:
        if not left:
            return value
        step, rest = left[0], left[1:]
        if isinstance(data, list | tuple):
            if isinstance(step, str):
                return [self._set(item, left, value, done) for item in data]
            if step < len(data):
                changed = self._set(data[step], rest, value, (*done, step))
                return [*data[:step], changed, *data[step + 1 :]]
        if isinstance(step, int):
            items = len(data) if isinstance(data, list | tuple) else 0
            raise InputError(f"vary {self.key}: {_dotted(done)} must have an item {step}, got {items} items")
        if data is not None and not isinstance(data, Mapping):
            raise InputError(f"vary {self.key}: {_dotted(done)} must be a mapping, got {shown(data)}")
        block = data or {}
        return {**block, step: self._set(block.get(step), rest, value, (*done, step))}

    def unit(self, part: Any) -> str:
        """Return the field's unit from its description, in a task or robot; empty if it has none."""
        description, step = "", ""
        for step in () if self.whole else self.steps:
            if isinstance(step, int):
                part = part[min(step, len(part) - 1)]  # an item has its list's unit; cut cables are gone
                continue
            if isinstance(part, tuple):
                part = part[0]
            if isinstance(part, dict):
                description, part = "", part[step]
            else:
                description, part = type(part).model_fields[step].description or "", getattr(part, step)
        found = _UNIT.search(description)
        units = found[1].split(", ") if found else [""]
        # The units of a pose: lengths, then angles.
        return units[step >= 3] if len(units) == 2 and isinstance(step, int) else ", ".join(units)


def _dotted(steps: tuple[str | int, ...]) -> str:
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps).removeprefix(".")
