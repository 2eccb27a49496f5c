"""Find the fastest time law under half-planes in (d2s/dt2, (ds/dt)^2), by toppra. Only this file imports toppra.

With u = d2s/dt2 and x = (ds/dt)^2, which changes by 2 u ds, the fastest law is a sequence of linear programs in two
variables: backwards, which x can still come to rest at the end; forwards, the largest u. Between two grid points u is
constant and the limits of both points hold (the Interpolation scheme). Source: H. Pham, Q.-C. Pham, "A new approach to
time-optimal path parameterization based on reachability analysis", IEEE T-RO 34(3), 2018.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from typing_extensions import override

from ...base.quiet import quiet

STEEPNESS = 1e-4  # of the largest row along u; toppra drops 1e-8 of x at each step, which must be little beside x
UNLIMITED = 1e7  # x in toppra's units that no limit has stopped; its own bounds are at 1e8
ROUNDING = 1e-12  # of a row along u: less is zero
TOGETHER = 16  # half-planes that toppra takes together: it multiplies them by a dense matrix of twice their number
FARTHEST = 1e9  # u and x in toppra's units; a limit beyond does not count


class _LateModule(ModuleType):
    """A module whose names come from the real one, which is imported with the first of them."""

    def __getattr__(self, name: str) -> Any:
        _end()  # for a module, or another thread, that needs a name while the block runs
        return getattr(import_module(self.__name__), name)


@contextmanager
def imported_late(package: str, module: str) -> Iterator[None]:
    """Let `import package.module` inside the block wait until it is used, unless the package is imported already."""
    if package in sys.modules:
        yield
        return
    late = {name: _LateModule(name) for name in (package, f"{package}.{module}")}
    setattr(late[package], module, late[f"{package}.{module}"])
    try:
        sys.modules.update(late)
        yield
    finally:
        _end()


def _end() -> None:
    """Let all imports find the real modules again."""
    for name, module in list(sys.modules.items()):
        if type(module) is _LateModule:
            sys.modules.pop(name, None)


with imported_late("matplotlib", "pyplot"):  # toppra draws with it if asked to; it loads for longer than most laws take
    from toppra.algorithm import TOPPRA
    from toppra.constraint import LinearConstraint
    from toppra.constraint.linear_constraint import canlinear_colloc_to_interpolate
    from toppra.interpolator import AbstractGeometricPath


class Rows(NamedTuple):
    """Limits a u + b x + c <= 0 at N points, (N, K) each, in parts of what they limit, and the largest x, (N,)."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    x_max: np.ndarray

    def of(self, columns: slice) -> "Rows":
        """Return some of the limits, and the same largest x."""
        return Rows(self.a[:, columns], self.b[:, columns], self.c[:, columns], self.x_max)


class Law(NamedTuple):
    """The fastest law: x at the grid points, or the index of the last one from which the end cannot be reached."""

    x: np.ndarray | None
    stuck: int | None
    unlimited: bool = False


class _HalfPlanes(LinearConstraint):
    """Half-planes a u + b x + c <= 0 and bounds of x, as a constraint of toppra."""

    def __init__(self, rows: Rows):
        super().__init__()
        self.identical = True
        self._rows = rows

    @override
    def compute_constraint_params(self, path, gridpoints, *args, **kwargs):
        a, b, c, x_max = self._rows
        bounds = np.stack([np.zeros_like(x_max), x_max], axis=1)
        each = np.eye(a.shape[1])
        return canlinear_colloc_to_interpolate(a, b, c, each, np.zeros(len(each)), None, bounds, gridpoints, True)


class _Interval(AbstractGeometricPath):
    """The interval from 0 to an end, as a path of toppra, which needs no more: the rows contain the geometry."""

    def __init__(self, end: float):
        self._end = end

    @property
    @override
    def dof(self) -> int:
        return 1

    @property
    @override
    def path_interval(self) -> np.ndarray:
        return np.array([0.0, self._end])

    @property
    def duration(self) -> float:
        return self._end


def fastest(s: np.ndarray, rows: Rows) -> Law:
    """Return the largest x at every s, (N,) rising from 0, of a motion from rest to rest."""
    # Measured in this unit of length, u and x are numbers that toppra's absolute tolerances suit.
    steepest = float(np.abs(rows.a).max(initial=0.0))
    unit = np.sqrt(steepest / STEEPNESS) if steepest > ROUNDING else 1.0
    never, scaled = _normalised(Rows(rows.a / unit, rows.b / unit**2, rows.c, rows.x_max * unit**2))
    if never.any():
        return Law(None, int(np.argmax(never)))
    grid = s * unit
    with quiet("toppra"):  # which warns of laws that do not exist: a normal result here
        parts = [_HalfPlanes(scaled.of(slice(k, k + TOGETHER))) for k in range(0, scaled.a.shape[1], TOGETHER)]
        algorithm = TOPPRA(parts, _Interval(float(grid[-1])), gridpoints=grid, solver_wrapper="seidel")
        result: Any = algorithm.compute_parameterization(0.0, 0.0, return_data=True)  # hints: three or four values
    _, speeds, _, reach = result
    if speeds is None:
        lost = np.flatnonzero(np.isnan(reach).any(axis=1))
        return Law(None, int(lost[-1]) if lost.size else 0)
    stuck = ~(speeds[1:] + speeds[:-1] > 0)  # nan, or at rest until the next point
    if stuck.any():
        return Law(None, int(np.argmax(stuck)))
    x = speeds**2
    return Law(x / unit**2, None, bool(x.max() > UNLIMITED))


def _normalised(rows: Rows) -> tuple[Any, Rows]:
    """Return where a limit cannot hold, (N,), and rows of length one: toppra takes two short ones for parallel."""
    size = np.hypot(rows.a, rows.b)
    idle = size * FARTHEST <= np.abs(rows.c)
    per_size = 1.0 / np.where(idle, 1.0, size)
    a, b = np.where(idle, 0.0, rows.a * per_size), np.where(idle, 0.0, rows.b * per_size)
    c = np.where(idle, -1.0, rows.c * per_size)
    return np.any(idle & (rows.c > 0), axis=1), Rows(a, b, c, np.minimum(rows.x_max, 2 * UNLIMITED))
