"""Vectors of numbers, one for each problem: what `simd_llvm.py` does with sixteen, here on NumPy arrays of any length.

A work array is a list of rows. Each operation is one of IEEE 754 and rounds as that of `simd_llvm` does, so that both
give the same bits.

    x = load(work, row)
    y = where(x > 0.0, sqrt(x), splat(0.0))
    store(work, row, y)
"""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = [
    "TOGETHER",
    "WIDTH",
    "any_of",
    "floor",
    "gather",
    "load",
    "magnitude",
    "maximum",
    "minimum",
    "places",
    "scatter",
    "splat",
    "sqrt",
    "store",
    "vectors",
    "where",
]

WIDTH = 1  # a row of a work array is one entry of its list
TOGETHER = 4096  # problems in a vector: it fits in the processor's fastest memory


def vectors(size: int) -> Any:
    """Return a work array of so many rows."""
    return [np.float64(0.0)] * size


def splat(number: float) -> Any:
    """Return a number that stands for a vector of it."""
    return np.float64(number)


def load(work: list[Any], row: int) -> Any:
    """Return a row; nobody writes to it."""
    return work[row]


def store(work: list[Any], row: int, value: Any) -> None:
    """Replace a row."""
    work[row] = value


def places(rows: Any, each: int) -> Any:
    """Return where the numbers of so many rows begin, `each` of them apart, for `gather`."""
    return rows * each


def gather(array: Any, starts: Any, offset: int) -> Any:
    """Return the numbers at starts + offset of an array."""
    return array[starts + offset]


def scatter(array: Any, starts: Any, offset: int, values: Any) -> None:
    """Write numbers to their places, starts + offset, in an array."""
    array[starts + offset] = values


def where(chosen: Any, yes: Any, no: Any) -> Any:
    """Choose element by element."""
    return np.where(chosen, yes, no)


def any_of(chosen: Any) -> bool:
    """Return whether a mask holds anywhere."""
    return bool(np.any(chosen))


def sqrt(x: Any) -> Any:
    """Return the square root."""
    return np.sqrt(x)


def floor(x: Any) -> Any:
    """Return the largest whole number that is not above x."""
    return np.floor(x)


def magnitude(x: Any) -> Any:
    """Return the absolute value."""
    return np.abs(x)


def maximum(x: Any, y: Any) -> Any:
    """Return the larger, the second where one is nan."""
    return np.where(x > y, x, y)


def minimum(x: Any, y: Any) -> Any:
    """Return the smaller, the second where one is nan."""
    return np.where(x < y, x, y)
