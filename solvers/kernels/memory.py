"""Scratch memory of the scalar kernels, cleared; `compiled.py` puts NumPy arrays in its place.

A view of memory hands out Python's own numbers, with which the interpreter is several times as fast as with NumPy's.
"""

from __future__ import annotations

from typing import Any

__all__ = ["floats", "integers", "view"]


def floats(size: int) -> Any:
    """Return so many numbers of type float64."""
    return memoryview(bytearray(8 * size)).cast("d")


def integers(size: int) -> Any:
    """Return so many numbers of type int64."""
    return memoryview(bytearray(8 * size)).cast("q")


def view(array: Any) -> Any:
    """Return an array as memory."""
    return memoryview(array)
