"""Check the numbers that describe a cable."""

from typing import Any

import numpy as np

from ...base.errors import InputError

MOST_PARTS = 1_000_000  # of a cable


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


def _number(name: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be a number, got {value!r}") from None
