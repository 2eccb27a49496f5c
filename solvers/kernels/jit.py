"""How the kernels of this room are compiled: without the GIL, kept on the disk where Numba finds a folder for them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import config

__all__ = ["GIVEN", "VECTOR", "has_room", "jit"]

VECTOR = numba.float64[::1]
GIVEN = numba.types.Array(numba.float64, 1, "C", readonly=True)

_ROOM = 50_000_000  # bytes; the machine code of this room takes about 5 MB


def has_room() -> bool:
    """Whether the disk has room for machine code: Numba would raise when it is full."""
    place = Path(getattr(config, "CACHE_DIR", "") or __file__)
    try:
        return shutil.disk_usage(next(folder for folder in (place, *place.parents) if folder.exists())).free > _ROOM
    except OSError:
        return False


def jit(*arguments: Any, **options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Compile as `numba.njit` does; division by zero gives inf or nan, as in NumPy."""
    settings = {"nogil": True, "error_model": "numpy", **options}

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        try:
            return numba.njit(*arguments, cache=has_room(), **settings)(function)
        except RuntimeError:  # no folder can be written
            return numba.njit(*arguments, **settings)(function)

    return decorate
