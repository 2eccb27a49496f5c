"""Check arguments, and refuse wrong ones in one line: the field, what is accepted, the value."""

import difflib
import os
from collections.abc import Collection
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .errors import InputError as InputError  # most modules that check arguments raise it
from .text import quantity

Kind = TypeVar("Kind")

FLOAT = np.dtype(np.float64)

_LONGEST = 60  # letters of a value in a message
LONGEST_TEXT = 240  # letters of a path or of a part of a message
MOST_DIMENSIONS = 32  # leading ones, with which NumPy combines arrays
MOST_ROWS = 100_000  # of a list of rows of numbers in a field
TINY, HUGE = 1e-300, 1e300  # between which a number above zero has an inverse


def shown(value: object) -> str:
    """Return a value in one short line, for a message."""
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of shape {value.shape}"
    try:
        return printable(" ".join(repr(value).split()), _LONGEST)
    except Exception:  # an int of more than 4300 digits, lists within lists without end, a class of the user's
        return f"{type(value).__name__} without a short form"


def printable(text: str, longest: int = LONGEST_TEXT) -> str:
    """Return text in one line that a terminal shows as it is: paths and files may hold line breaks and escapes."""
    line = "".join(char if char.isprintable() else repr(char)[1:-1] for char in " ".join(text.splitlines()))
    return line if len(line) <= longest else f"{line[: longest - 3]}..."


def with_fields(function: str, given: dict[str, Any], *objects: Any) -> list[Any]:
    """Return dataclasses with the fields that are `given`, each in the one that has it.

    Raises `InputError` if none has a field: `function` has no such argument.
    """
    names = [field.name for one in objects for field in fields(one)]
    for name in given:
        if name not in names:
            close = difflib.get_close_matches(name, names, n=1)
            meant = f", did you mean {close[0]!r}?" if close else f"; the options are {', '.join(names)}"
            raise InputError(f"{function} has no argument {printable(name, _LONGEST)!r}{meant}")
    own = [{field.name for field in fields(one)} & set(given) for one in objects]
    return [replace(one, **{name: given[name] for name in its}) for one, its in zip(objects, own, strict=True)]


def required(name: str, value: object, kind: type[Kind]) -> Kind:
    """Return `value`, or raise InputError unless it is a `kind`."""
    if not isinstance(value, kind):
        raise InputError(f"{name} must be a {kind.__name__}, got {shown(value)} of type {type(value).__name__}")
    return value


def number(name: str, value: object, least: float, most: float, also: str = "") -> float:
    """Return a number from `least` to `most`, or raise InputError; `also` adds to the message what else is accepted."""
    if isinstance(value, float | int | np.floating | np.integer) and not isinstance(value, bool | np.timedelta64):
        # A whole number may have no float.
        as_float = np.inf if isinstance(value, int) and abs(value) > 10**300 else float(value)
        if least <= as_float <= most:
            return as_float
    raise InputError(f"{name} must be a number from {least:g} to {most:g}{also}, got {shown(value)}")


def whole_number(name: str, value: object, least: int, most: int) -> int:
    """Return a whole number from `least` to `most`, or raise InputError."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64) and least <= value <= most:
        return int(value)
    raise InputError(f"{name} must be a whole number from {quantity(least)} to {quantity(most)}, got {shown(value)}")


def flag(name: str, value: object) -> bool:
    """Return True or False, or raise InputError."""
    if not isinstance(value, bool | np.bool_):
        raise InputError(f"{name} must be True or False, got {shown(value)}")
    return bool(value)


def one_of(name: str, value: object, accepted: Collection[str]) -> str:
    """Return a word that is among those accepted, or raise InputError."""
    if not isinstance(value, str) or value not in accepted:
        raise InputError(f"{name} must be one of {', '.join(accepted)}, got {shown(value)}")
    return value


def file_path(name: str, value: object, accepted: str = "a path") -> Path:
    """Return a text or path-like object as a path, or raise InputError; `accepted` is what the message names."""
    try:
        text = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    except Exception:  # of a class of the user's
        text = None
    if not isinstance(text, str) or not text or "\0" in text:
        raise InputError(f"{name} must be {accepted}, got {shown(value)}")
    return Path(text)


def check_ending(name: str, path: Path, *accepted: str) -> Path:
    """Return a path, or raise InputError unless its name has one of the `accepted` endings, such as ".nc"."""
    if path.suffix.lower() not in accepted:
        raise InputError(f"{name} must end in {' or '.join(accepted)}, got {shown(str(path))}")
    return path


def real_array(name: str, value: Any) -> NDArray[Any]:
    """Return `value` as an array of real numbers, without a copy where it is one, or raise InputError."""
    try:
        array = np.asarray(value)
    except Exception:  # whatever the array interface of another library raises
        raise InputError(
            f"{name} must be an array of real numbers, got {shown(value)} (rows of unequal length?)"
        ) from None
    # Plain arrays and lists do not ask numpy.ma, whose import takes longer than solving 10 000 problems.
    if isinstance(value, np.ndarray) and type(value) is not np.ndarray and np.ma.is_masked(value):
        raise InputError(f"{name} must be an array of real numbers without masked entries, got {shown(value)}")
    if array.dtype.kind not in "fiu":
        given = shown(value) if array.ndim == 0 else f"entries of type {array.dtype.name}"
        raise InputError(f"{name} must be an array of real numbers, got {given}")
    return float64(array) if array.dtype.itemsize > FLOAT.itemsize else array


def float64(array: NDArray[Any]) -> NDArray[np.float64]:
    """Return numbers as float64, without a copy where they are; what a longer float has beyond is infinite."""
    with np.errstate(over="ignore"):
        return array.astype(FLOAT, copy=False)


def finite_array(name: str, value: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return a float64 copy of `value` of this shape, -1 for any length, or raise InputError unless it is finite."""
    given = real_array(name, value)
    accepted = f"{name} must be an array of shape {str(shape).replace('-1', 'n')} of finite numbers"
    # Before the copy: a view of one number may have any shape.
    if given.ndim != len(shape) or any(want not in (-1, have) for want, have in zip(shape, given.shape, strict=True)):
        raise InputError(f"{accepted}, got one of shape {given.shape}")
    array = np.array(given, dtype=np.float64)
    if not np.isfinite(array).all():
        raise InputError(f"{accepted}, got {shown(array.tolist())}")
    return array


def repeated(name: str, value: Any, size: int) -> NDArray[np.float64]:
    """Return a float64 copy of one number or `size` of them as (size,), or raise InputError for another shape."""
    given = real_array(name, value)
    if given.shape not in ((), (size,)):
        raise InputError(f"{name} must be of shape ({size},), or a single number, got shape {given.shape}")
    return np.full(size, given, dtype=np.float64)


def check_dimensions(name: str, count: int) -> None:
    """Raise InputError if an array has more leading dimensions than `MOST_DIMENSIONS`."""
    if count > MOST_DIMENSIONS:
        raise InputError(f"{name} must have at most {MOST_DIMENSIONS} leading dimensions, got {count}")


def leading(shapes: dict[str, tuple[int, ...]]) -> tuple[int, ...]:
    """Return the common leading dimensions of arguments, from those of each.

    Raises `InputError` if they differ where none is 1, or are more than NumPy has.
    """
    for name, shape in shapes.items():
        check_dimensions(name, len(shape))
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        given = {name: str(shape) for name, shape in shapes.items() if shape}
        accepted = f"{', '.join(given)} must have leading dimensions that are equal or 1"
        raise InputError(f"{accepted}, got {', '.join(given.values())}") from None
