"""Check the numbers that describe a cable."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InputError


def positive(name: str, value: Any, infinite: bool = False) -> float:
    """Return `value` as a float above zero, or raise InputError; `infinite` permits infinity."""
    number = _number(name, value)
    if not number > 0 or (np.isinf(number) and not infinite):
        raise InputError(f"{name} must be a {'' if infinite else 'finite '}number > 0, got {number:g}")
    return number


def non_negative(name: str, value: Any) -> float:
    """Return `value` as a finite float of zero or more, or raise InputError."""
    number = _number(name, value)
    if not 0 <= number < np.inf:
        raise InputError(f"{name} must be a finite number >= 0, got {number:g}")
    return number


def count(name: str, value: Any, least: int) -> int:
    """Return `value` as a whole number of at least `least`, or raise InputError."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise InputError(f"{name} must be a whole number >= {least}, got {value!r}")
    return int(value)


def array(name: str, value: Any, shape: tuple[int | None, ...]) -> np.ndarray:
    """Return `value` as finite floats whose last dimensions are `shape` (None for any), or raise InputError."""
    sizes = ", ".join("n" if size is None else str(size) for size in shape)
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be an array of numbers of shape (..., {sizes}), got {value!r}") from None
    last = numbers.shape[numbers.ndim - len(shape) :]
    if numbers.ndim < len(shape) or any(want not in (None, got) for want, got in zip(shape, last, strict=True)):
        raise InputError(f"{name} must have the shape (..., {sizes}), got {numbers.shape}")
    if not np.isfinite(numbers).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(numbers))[0])
        raise InputError(f"{name} must have finite numbers, got {numbers[index]} at index {index}")
    return numbers


def _number(name: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a number, got {value!r}") from None
