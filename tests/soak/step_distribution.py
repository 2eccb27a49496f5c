"""The tension distribution inside an exported control step, compiled here and called with problems of any robot."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from towline.models import Robot, load

from .step_code import compiled_step

__all__ = ["CABLES", "Distributed", "StepDistribution"]

Array = NDArray[np.float64]

SOURCE = Path(__file__).parent / "step_distribution.c"
CABLES = 12  # of the robot whose step it is, and so the most that a problem may have


class Distributed(NamedTuple):
    """The answers to many problems of one shape."""

    status: NDArray[np.intc]  # (N,)
    tensions: Array  # (N, m) [N]
    direction: Array  # (N, n)


class StepDistribution:
    """The step of a robot of twelve cables, in double or float.

    Args:
        precision: "double" or "float".
        folder: Gets the files and the library.

    Raises:
        InputError: If there is no C compiler, command cc.
    """

    def __init__(self, precision: str, folder: Path):
        robot = load("cogiro").model_dump()
        cables = [*robot["cables"], *robot["cables"]][:CABLES]
        library = compiled_step(Robot.model_validate({**robot, "cables": cables}), precision, folder, (str(SOURCE),))
        self._real = np.float32 if precision == "float" else np.float64
        self._solve = library.distribute_rows
        self._solve.restype = None

    def solve(self, *problems: Array) -> Distributed:
        """Solve problems: A (N, n, m), w, t_min, t_max, t_ref, weights, and the lengths (N,)."""
        given = [np.ascontiguousarray(array, self._real) for array in problems]
        count, n, m = given[0].shape
        status = np.empty(count, np.intc)
        tensions, direction = np.empty((count, m), self._real), np.zeros((count, n), self._real)
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (*given, status, tensions, direction)]
        self._solve(count, n, m, *pointers)
        return Distributed(status, tensions.astype(np.float64), direction.astype(np.float64))
