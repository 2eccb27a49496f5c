"""The exported control step of a robot, compiled here and called with many states at once."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from towline.base.errors import InputError
from towline.export.step.export import moving_carriers, step_files
from towline.models import Dynamics, Robot

Array = NDArray[np.float64]

FLAGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-ffp-contract=off")
ROWS = Path(__file__).parent / "step_rows.c"


def compiled_step(
    robot: Robot,
    precision: str,
    folder: Path,
    sources: tuple[str, ...],
    compiler: str = "cc",
    flags: tuple[str, ...] = ("-O2",),
) -> ctypes.CDLL:
    """Export the step of a robot, compile sources with it, and load the library; errors as of `StepCode`."""
    if shutil.which(compiler) is None:
        raise InputError(f"compiler must be a C compiler in PATH, got {compiler!r}")
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in step_files(robot, precision).items():
        (folder / name).write_text(text, encoding="utf-8")
    library = folder / "step.so"
    command = [compiler, *FLAGS, *flags, f"-I{folder}", "-fPIC", "-shared", *sources, "-lm", "-o", str(library)]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(library))


class Steps(NamedTuple):
    """The answers to N states."""

    status: NDArray[np.intc]  # (N,)
    counts: NDArray[np.intc]  # (N, 2) outer and inner iterations
    tensions: Array  # (N, m) [N]
    direction: Array  # (N, 6)
    numbers: Array  # (N, 3) residual, support and shortfall [N]


class States(NamedTuple):
    """N states of a robot, as `Dynamics` takes them."""

    pose: Array  # (N, 6), as are the next two
    velocity: Array
    acceleration: Array
    carrier_pose: Array  # (N, c, 6)
    wind: Array | None  # (N, 3)
    disturbance: Array  # (N, 6)

    def rows(self, robot: Robot) -> Array:
        """Return the columns that the example program reads, (N, k)."""
        moving = self.carrier_pose[:, moving_carriers(robot)].reshape(len(self.pose), -1)
        wind = [] if self.wind is None else [self.wind]
        return np.hstack([self.pose, self.velocity, self.acceleration, moving, *wind, self.disturbance])

    def problems(self, dynamics: Dynamics) -> tuple[Array, Array]:
        """Return A, (N, 6, m), and w, (N, 6), by Python; w is nan where the state is not finite."""
        mask = dynamics.robot.dof_mask
        state = np.hstack([self.pose, self.velocity, self.acceleration])  # (N, 18)
        whole = np.isfinite(state).all(axis=1, keepdims=True)
        pose, velocity, acceleration = np.split(np.where(whole, state, 0.0), 3, axis=1)
        with np.errstate(invalid="ignore"):
            A = np.asarray(dynamics.wrench_matrix(pose, self.carrier_pose)) * mask[:, None]
            w = dynamics.required_wrench(pose, velocity, acceleration, self.carrier_pose, wind=self.wind)
        return A, np.where(whole, (np.asarray(w) - self.disturbance) * mask, np.nan)

    def select(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> States:
        """Return some of the states."""
        wind = None if self.wind is None else self.wind[rows]
        pose, velocity, acceleration = self.pose[rows], self.velocity[rows], self.acceleration[rows]
        return States(pose, velocity, acceleration, self.carrier_pose[rows], wind, self.disturbance[rows])


class StepCode:
    """The step of a robot as a library of this process.

    Args:
        robot: Whose step.
        precision: "double" or "float".
        folder: Gets the files and the library.
        compiler, flags: The command, and what it gets beside `FLAGS`.

    Raises:
        InputError: If there is no such compiler.
    """

    def __init__(
        self, robot: Robot, precision: str, folder: Path, compiler: str = "cc", flags: tuple[str, ...] = ("-O2",)
    ):
        self.robot, self.precision = robot, precision
        self._library = compiled_step(robot, precision, folder, (str(ROWS), "towline_step.c"), compiler, flags)

    def run(self, rows: Array) -> Steps:
        """Compute steps that do not depend on each other, of rows as from `States.rows`."""
        rows = np.ascontiguousarray(rows, dtype=np.float64)
        n, m = len(rows), self.robot.m
        counts = np.empty((n, 2), np.intc)
        steps = Steps(np.empty(n, np.intc), counts, np.empty((n, m)), np.empty((n, 6)), np.empty((n, 3)))
        self._library.step_rows(n, *(_pointer(array) for array in (rows, *steps)))
        return steps

    def times(self, rows: Array, calls: int = 20, repeats: int = 5) -> Array:
        """Return the time of each step [s], (N,): the mean of `calls`, the least of `repeats`."""
        rows, seconds = np.ascontiguousarray(rows, dtype=np.float64), np.empty(len(rows))
        self._library.step_times(len(rows), _pointer(rows), calls, repeats, _pointer(seconds))
        return seconds


def _pointer(array: NDArray[np.generic]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
