"""Numbers that describe a cable, checked where they come in."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError


def positive(name: str, value: Any, infinite: bool = False) -> float:
    """`value` as a float above zero; `infinite`: infinity will do too. Raises `InputError`."""
    number = _number(name, value)
    if not number > 0 or (np.isinf(number) and not infinite):
        raise InputError(f"{name}: is {number:g}; accepted: a {'' if infinite else 'finite '}number > 0")
    return number


def non_negative(name: str, value: Any) -> float:
    """`value` as a finite float of zero or more. Raises `InputError`."""
    number = _number(name, value)
    if not 0 <= number < np.inf:
        raise InputError(f"{name}: is {number:g}; accepted: a finite number >= 0")
    return number


def count(name: str, value: Any, least: int) -> int:
    """`value` as a whole number of at least `least`. Raises `InputError`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise InputError(f"{name}: is {value!r}; accepted: a whole number >= {least}")
    return int(value)


def array(name: str, value: Any, shape: tuple[int | None, ...]) -> np.ndarray:
    """`value` as finite floats whose last dimensions are `shape`, None standing for any. Raises `InputError`."""
    told = ", ".join("n" if size is None else str(size) for size in shape)
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: {value!r} is not an array of numbers; accepted: shape (..., {told})") from None
    last = numbers.shape[numbers.ndim - len(shape) :]
    if numbers.ndim < len(shape) or any(want not in (None, got) for want, got in zip(shape, last, strict=True)):
        raise InputError(f"{name}: has shape {numbers.shape}; accepted: (..., {told})")
    if not np.isfinite(numbers).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(numbers))[0])
        raise InputError(f"{name}: is {numbers[index]} at index {index}; accepted: finite numbers")
    return numbers


def _number(name: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name}: is {value!r}; accepted: a number") from None
