"""Solve the QP of a predictive controller stage by stage: `solve_horizon`, and `Horizon` for control loops.

The method, its conditions and its sources are described in `docs/horizon.md`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..base.display import Displayed, record
from ..base.errors import InputError
from ..base.inputs import number, shown, whole_number
from .stage_problem import Array, StageProblem
from .stages import layout, machine
from .stages.sizes import padded, places

__all__ = ["Horizon", "HorizonSolution", "Multipliers", "Residuals", "solve_horizon"]


class Multipliers(NamedTuple):
    """Multipliers of a solution, per unit of what they limit.

    Attributes
    ----------
    dynamics :
        Of A x + B u + c = x of the next stage, shape (N, n).
    lower, upper :
        Of the bounds of controls, shape (N, m), not negative.
    rows :
        Of the soft rows, shape (N, p), from 0 to the slope of their penalty.
    """

    dynamics: Array  # (N, n)
    lower: Array  # (N, m)
    upper: Array  # (N, m)
    rows: Array  # (N, p)

    __repr__ = record


class Residuals(NamedTuple):
    """Errors of the conditions of optimality, relative to the largest of its terms (`docs/horizon.md`).

    Attributes
    ----------
    stationarity :
        Of the gradient of the Lagrangian.
    dynamics :
        Of the dynamics.
    complementarity :
        Of the products of multipliers and distances to bounds.
    soft :
        Of the multipliers of soft rows, which are to be slopes of the penalty.
    """

    stationarity: float
    dynamics: float
    complementarity: float
    soft: float

    __repr__ = record


@dataclass(slots=True, eq=False)
class HorizonSolution(Displayed):
    """Controls and states of all stages, and how near they are to the optimum.

    Attributes
    ----------
    states, controls :
        Shapes (N + 1, n) and (N, m). Controls never break their bounds, and states are what they lead to.
    multipliers :
        See `Multipliers`.
    residuals :
        See `Residuals`.
    converged :
        Whether all residuals are within the tolerance. If not, this is the best iterate.
    iterations :
        How many Newton matrices were factorised, without the one of a cold start.
    """

    states: Array  # (N + 1, n)
    controls: Array  # (N, m)
    multipliers: Multipliers
    residuals: Residuals
    converged: bool
    iterations: int

    @property
    def status(self) -> str:
        """Return "converged" or "not converged"."""
        return "converged" if self.converged else "not converged"

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists, numbers and strings, ready for JSON."""
        return {
            "status": self.status,
            "states": self.states.tolist(),
            "controls": self.controls.tolist(),
            "multipliers": {name: array.tolist() for name, array in self.multipliers._asdict().items()},
            "residuals": self.residuals._asdict(),
            "iterations": self.iterations,
        }


def solve_horizon(
    problem: StageProblem,
    start: HorizonSolution | None = None,
    iterations: int = 50,
    tolerance: float = 1e-8,
) -> HorizonSolution:
    """Solve a problem of stages by an interior-point method with a Riccati recursion.

    Parameters
    ----------
    problem :
        The problem.
    start :
        The solution of a similar problem of the same sizes, from which fewer iterations are needed. default: none.
    iterations :
        The largest number of iterations, from 1 to 1000.
    tolerance :
        The largest residual of a solution that counts as converged, from 1e-12 to 1.

    Raises
    ------
    InputError
        If an argument has a wrong type, or `start` other sizes.
    """
    if not isinstance(problem, StageProblem):
        raise InputError(f"problem must be a StageProblem, got {type(problem).__name__}")
    iterations, tolerance = whole_number("iterations", iterations, 1, 1000), number("tolerance", tolerance, 1e-12, 1.0)
    horizon = Horizon(problem.N, problem.n, problem.m, problem.p)
    horizon.iterations_max, horizon.tolerance = int(iterations), float(tolerance)
    for name in _FIELDS:
        getattr(horizon, name)[...] = getattr(problem, name)
    if start is not None:
        if not isinstance(start, HorizonSolution):
            raise InputError(f"start must be a HorizonSolution or None, got {type(start).__name__}")
        there = (horizon.states, horizon.controls, *horizon.multipliers)
        given = (start.states, start.controls, *start.multipliers)
        if any(a.shape != b.shape for a, b in zip(there, given, strict=True)):
            raise InputError(f"start must be of the problem's sizes, got controls of shape {start.controls.shape}")
        for a, b in zip(there, given, strict=True):
            a[...] = b
    horizon.solve(warm=start is not None)
    return HorizonSolution(
        horizon.states.copy(),
        horizon.controls.copy(),
        Multipliers(*[array.copy() for array in horizon.multipliers]),
        horizon.residuals,
        horizon.converged,
        horizon.iterations,
    )


_FIELDS = ("A", "B", "start", "Q", "R", "c", "S", "q", "r", "u_min", "u_max", "C", "D", "d", "penalty", "square")


class Horizon(Displayed):
    """Problems of one size, to be written into its arrays, solved, and written again.

    A predictive controller solves such a problem at each step. All arrays are parts of one, in the layout of the
    machine code: nothing is copied, allocated or checked. What is no problem (numbers that are not finite, a cost that
    is not convex) is answered with controls that are finite and inside their bounds, and not converged.

    Parameters
    ----------
    N, n, m, rows :
        How many stages, states, controls, and soft rows of a stage.

    Attributes
    ----------
    A, B, c, start, Q, R, S, q, r, u_min, u_max, C, D, d, penalty, square :
        As of `StageProblem`, zero at first, and bounds infinite. Q and R must be symmetric.
    states, controls, multipliers :
        As of `HorizonSolution`; they are also what `solve(warm=True)` begins with.
    tolerance, iterations_max :
        When to stop.

    Raises
    ------
    InputError
        If a size is no whole number in its range.
    """

    def __init__(self, N: int, n: int, m: int, rows: int = 0):
        N, n, m = (whole_number(name, value, 1, 1000) for name, value in (("N", N), ("n", n), ("m", m)))
        rows = whole_number("rows", rows, 0, 1000)
        self._sizes = N, n, m, rows
        self._places, size = places(*self._sizes)
        self._work = np.zeros(size)
        w, wp, mp, pp = n + m, padded(n + m), padded(m), padded(rows)

        def part(block: int, *shape: int, at: int = 0) -> Array:
            begin = self._places[block] + at
            return self._work[begin : begin + int(np.prod(shape))].reshape(shape)

        hessian, dynamics = part(layout.HESSIAN, N + 1, w, wp), part(layout.DYNAMICS, N, n, wp)
        self.R, self.S, self.Q = hessian[:N, :m, :m], hessian[:N, :m, m:w], hessian[:, m:w, m:w]
        self.B, self.A = dynamics[:, :, :m], dynamics[:, :, m:w]
        self.c, self.start = part(layout.OFFSET, N, padded(n))[:, :n], part(layout.START, n)
        gradient, rows_of = part(layout.GRADIENT, N + 1, wp), part(layout.ROWS, N, rows, wp)
        self.r, self.q = gradient[:N, :m], gradient[:, m:w]
        self.D, self.C = rows_of[:, :, :m], rows_of[:, :, m:w]
        self.u_min, self.u_max = part(layout.LOWEST, N, mp)[:, :m], part(layout.HIGHEST, N, mp)[:, :m]
        self.u_min.fill(-np.inf)
        self.u_max.fill(np.inf)
        blocks = (layout.LIMIT, layout.WEIGHT, layout.SQUARE)
        self.d, self.penalty, self.square = [part(block, N, pp)[:, :rows] for block in blocks]
        point, costate = part(layout.POINT, N + 1, wp), part(layout.COSTATE, N + 1, wp)
        self.controls, self.states = point[:N, :m], point[:, m:w]
        bounds = N * mp
        lower, upper = (part(layout.MULTIPLIER, N, mp, at=at)[:, :m] for at in (0, bounds))
        rows_force = part(layout.MULTIPLIER, N, pp, at=2 * bounds)[:, :rows]
        self.multipliers = Multipliers(costate[1:, m:w], lower, upper, rows_force)
        # Where there is no such limit, slack and multiplier stay one.
        part(layout.SLACK, 2 * self._places[layout.PAIRS]).fill(1.0)
        part(layout.FREE, wp)[:m] = 1.0
        part(layout.MASK, 2 * N, pp, at=2 * bounds)[:, :rows] = 1.0
        self._settings = np.zeros(layout.SETTINGS)
        self.tolerance, self.iterations_max = 1e-8, 50
        self._kernel = machine.solve_stages()

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle the one array, whose parts the others are."""
        state = self._work.copy(), self._settings.copy(), self.tolerance, self.iterations_max
        return _restored, (self._sizes, *state)

    def solve(self, shifted: bool = False, warm: bool = False) -> bool:
        """Solve the problem in the arrays, and return whether the solution converged.

        Parameters
        ----------
        shifted :
            Begin with the last solution moved by one stage, as a controller does that solves once a stage.
        warm :
            Begin with the last solution, or what is written into `states`, `controls` and `multipliers`.

        Raises
        ------
        InputError
            If an argument is no truth.
        """
        for name, value in (("shifted", shifted), ("warm", warm)):
            if value is not True and value is not False:
                raise InputError(f"{name} must be True or False, got {shown(value)}")
        settings = self._settings
        settings[layout.WARM] = layout.SHIFTED if shifted else layout.AS_IT_IS if warm else layout.COLD
        settings[layout.TOLERANCE], settings[layout.ITERATIONS] = self.tolerance, self.iterations_max
        self._kernel(self._work, self._places, settings)
        return self.converged

    @property
    def converged(self) -> bool:
        """Return whether the last solution converged."""
        return bool(self._settings[layout.CONVERGED])

    @property
    def iterations(self) -> int:
        """Return how many iterations the last solution took."""
        return int(self._settings[layout.COUNT])

    @property
    def residuals(self) -> Residuals:
        """Return the residuals of the last solution."""
        return Residuals(*self._settings[layout.STATIONARITY : layout.SOFT + 1].tolist())


def _restored(sizes: tuple[int, ...], work: Array, settings: Array, tolerance: float, iterations: int) -> Horizon:
    horizon = Horizon(*sizes)
    horizon._work[:], horizon._settings[:] = work, settings
    horizon.tolerance, horizon.iterations_max = tolerance, iterations
    return horizon
