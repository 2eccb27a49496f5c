"""What arguments are refused, in one line each."""

from typing import TypeVar

import numpy as np

from .errors import InputError

__all__ = ["number", "required", "shown", "whole_number"]

Kind = TypeVar("Kind")

_LONGEST = 60  # letters of a value in a message


def shown(value: object) -> str:
    """Return a value in one short line, for a message."""
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of shape {value.shape}"
    text = " ".join(repr(value).split())
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."


def required(name: str, value: object, kind: type[Kind]) -> Kind:
    """Return `value`, or raise InputError if it is no `kind`."""
    if not isinstance(value, kind):
        raise InputError(f"{name}: is a {type(value).__name__}; accepted: a {kind.__name__}")
    return value


def number(name: str, value: object, least: float, most: float, also: str = "") -> float:
    """Return a number from `least` to `most`, or raise InputError; `also` says what else would have been accepted."""
    if isinstance(value, float | int | np.floating | np.integer) and not isinstance(value, bool):
        # A whole number may have no float.
        as_float = np.inf if isinstance(value, int) and abs(value) > 10**300 else float(value)
        if least <= as_float <= most:
            return as_float
    raise InputError(f"{name}: is {shown(value)}; accepted: a number from {least:g} to {most:g}{also}")


def whole_number(name: str, value: object, least: int, most: int) -> int:
    """Return a whole number from `least` to `most`, or raise InputError."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool) and least <= value <= most:
        return int(value)
    raise InputError(f"{name}: is {shown(value)}; accepted: a whole number from {least} to {most}")
