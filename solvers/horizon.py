"""Solve the QP of a predictive controller stage by stage.

The method, its conditions and its sources are described in `docs/horizon.md`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.display import Displayed, record
from ..base.errors import InputError
from ..base.inputs import shown, whole_number
from .stages import layout, machine
from .stages.sizes import padded, places

__all__ = ["Horizon", "Multipliers", "Residuals"]

Array = NDArray[np.float64]


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


class Horizon(Displayed):
    r"""Problems of one size, to be written into its arrays, solved, and written again.

    $$
    \min \; \sum_{k=0}^{N-1} \tfrac12 \begin{bmatrix} x_k \\ u_k \end{bmatrix}^\top
    \begin{bmatrix} Q_k & S_k^\top \\ S_k & R_k \end{bmatrix} \begin{bmatrix} x_k \\ u_k \end{bmatrix}
    + q_k^\top x_k + r_k^\top u_k + \rho_k^\top s_k + \tfrac12 s_k^\top \mathrm{diag}(\sigma_k) s_k
    \; + \tfrac12 x_N^\top Q_N x_N + q_N^\top x_N
    $$

    subject to $x_{k+1} = A_k x_k + B_k u_k + c_k$ from a given $x_0$, $u_{\min,k} \le u_k \le u_{\max,k}$ and
    $C_k x_k + D_k u_k \le d_k + s_k$, $s_k \ge 0$. It is feasible for any data.

    A predictive controller solves such a problem at each step. All arrays are parts of one, in the layout of the
    machine code: nothing is copied, allocated or checked. Where a number is not finite or the cost is not convex, the
    controls are still finite and inside their bounds, and the solution is not converged.

    Parameters
    ----------
    N, n, m, rows :
        How many stages, states, controls, and soft rows of a stage (p).

    Attributes
    ----------
    A, B, c :
        Dynamics, shapes (N, n, n), (N, n, m) and (N, n). All arrays are zero at first, but for the bounds.
    start :
        The state x of stage 0, shape (n,).
    Q, R, S :
        Cost, shapes (N + 1, n, n), (N, m, m) and (N, m, n); together convex, Q and R symmetric. R may be zero.
    q, r :
        Linear cost, shapes (N + 1, n) and (N, m).
    u_min, u_max :
        Bounds of controls, shape (N, m), infinite at first. They may be equal.
    C, D, d :
        Soft rows, shapes (N, p, n), (N, p, m) and (N, p).
    penalty, square :
        Linear and quadratic cost of breaking each soft row, not negative, shape (N, p). A linear one that is larger
        than the multiplier which the row has as a constraint keeps it exactly.
    states, controls :
        The solution, shapes (N + 1, n) and (N, m). Controls never break their bounds, and states are what they lead to.
    multipliers :
        See `Multipliers`. `solve(warm=True)` begins with these, and with states and controls.
    tolerance, iterations_max :
        When to stop: the largest residual of a solution that has converged, and the largest number of iterations. At
        first 1e-8 and 50.

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
        """Return how many Newton matrices the last solution took, without the one of a cold start."""
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
