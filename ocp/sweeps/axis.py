"""`Axis`: one field and the values that it takes in a sweep; from lists of values, or from the text of an option."""

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
from ...base.errors import InputError
from ...base.inputs import shown
from ...models.parsing import parse_yaml
from ...models.part import Part
from .field import Field

MOST_PLANS = 100_000
MOST_AXES, MOST_COLUMNS = 3, 6  # of a figure
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,2})?"
_RANGE = re.compile(rf"({_NUMBER}):({_NUMBER}):({_NUMBER})")


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
