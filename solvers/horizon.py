"""Solve the QP of a predictive controller stage by stage.

The method, its conditions and its sources are described in `docs/horizon.md`.
"""

from typing import Any, NamedTuple

import numpy as np

from ..base.display import Displayed, record
from ..base.inputs import InputError, flag, real_array, whole_number
from ..core import PROCESSOR, horizon_places, horizon_relative_to, horizon_size, horizon_solve
from .problem import Array

COLD, WARM, SHIFTED = 0, 1, 2  # of `towline_beginning`


class Multipliers(NamedTuple):
    """Multipliers of a solution, per unit of what they limit.

    Attributes:
        dynamics: Multipliers of A x + B u + c = x of the next stage, shape (N, n).
        lower, upper: Multipliers of the bounds of controls, shape (N, m), not negative.
        rows: Multipliers of the soft rows, shape (N, p), from 0 to the slope of their penalty.
    """

    dynamics: Array  # (N, n)
    lower: Array  # (N, m)
    upper: Array  # (N, m)
    rows: Array  # (N, p)

    __repr__ = record


class Residuals(NamedTuple):
    """Errors of the optimality conditions, each relative to its largest term (`docs/horizon.md`).

    Attributes:
        stationarity: Gradient of the Lagrangian.
        dynamics: Error of the dynamics.
        complementarity: Products of multipliers and distances to bounds.
        soft: Deviation of the multipliers of soft rows from slopes of the penalty.
    """

    stationarity: float
    dynamics: float
    complementarity: float
    soft: float

    __repr__ = record


class Horizon(Displayed):
    r"""Solve problems of one size: write the data into its arrays, and call `solve`.

    $$
    \min \; \sum_{k=0}^{N-1} \tfrac12 \begin{bmatrix} x_k \\ u_k \end{bmatrix}^\top
    \begin{bmatrix} Q_k & S_k^\top \\ S_k & R_k \end{bmatrix} \begin{bmatrix} x_k \\ u_k \end{bmatrix}
    + q_k^\top x_k + r_k^\top u_k + \rho_k^\top s_k + \tfrac12 s_k^\top \mathrm{diag}(\sigma_k) s_k
    \; + \tfrac12 x_N^\top Q_N x_N + q_N^\top x_N
    $$

    subject to $x_{k+1} = A_k x_k + B_k u_k + c_k$ from a given $x_0$, $u_{\min,k} \le u_k \le u_{\max,k}$ and
    $C_k x_k + D_k u_k \le d_k + s_k$, $s_k \ge 0$. It is feasible for any data.

    A predictive controller solves such a problem at each step. All arrays are views of the memory of the core
    (`core/horizon`): nothing is copied, allocated or checked. If a number is not finite or the cost is not convex, the
    controls are still finite and inside their bounds, and the solution has not converged.

    Args:
        N, n, m, rows: Numbers of stages, states, controls, and soft rows of a stage (p).

    Attributes:
        A, B, c: Dynamics, shapes (N, n, n), (N, n, m) and (N, n). All arrays except the bounds are zero at first.
        start: The state x of stage 0, shape (n,).
        Q, R, S: Cost, shapes (N + 1, n, n), (N, m, m) and (N, m, n); together convex, Q and R symmetric. R may be zero.
        q, r: Linear cost, shapes (N + 1, n) and (N, m).
        u_min, u_max: Bounds of controls, shape (N, m), infinite at first. They may be equal.
        C, D, d: Soft rows, shapes (N, p, n), (N, p, m) and (N, p).
        penalty, square: Linear and quadratic cost of violating each soft row, not negative, shape (N, p). A linear cost
            above the multiplier of the row as a hard constraint enforces it exactly.
        states, controls: The solution, shapes (N + 1, n) and (N, m). Controls are always inside their bounds, and
            states follow from them.
        multipliers: See `Multipliers`. `solve(warm=True)` starts from these, and from states and controls.
        tolerance, iterations_max: Largest residual of a converged solution, and largest number of iterations. Default:
            1e-8 and 50.
        converged, iterations: Success of the last solution, and the number of Newton systems solved, not counting
            the one of a cold start.

    Raises:
        InputError: If a size is not a whole number in its range.
    """

    def __init__(self, N: int, n: int, m: int, rows: int = 0):
        N, n, m = (whole_number(name, value, 1, 1000) for name, value in (("N", N), ("n", n), ("m", m)))
        rows = whole_number("rows", rows, 0, 1000)
        self._sizes = N, n, m, rows
        self._memory = np.zeros(horizon_size(*self._sizes))
        places = horizon_places(*self._sizes, self._memory)

        def part(name: str, *shape: int) -> Array:
            """Return an array in the memory, of which the core pads rows to multiples of four."""
            *blocks, columns = shape
            padded, begin = -(-columns // 4) * 4, places[name]
            whole = self._memory[begin : begin + int(np.prod(blocks)) * padded]
            return whole.reshape(*blocks, padded)[..., :columns]

        H, G, h = part("H", N + 1, m + n, m + n), part("G", N, n, m + n), part("h", N + 1, m + n)
        self.R, self.S, self.Q = H[:N, :m, :m], H[:N, :m, m:], H[:, m:, m:]
        self.B, self.A, self.r, self.q = G[:, :, :m], G[:, :, m:], h[:N, :m], h[:, m:]
        self.c, self.start = part("c", N, n), part("start", n)
        self.u_min, self.u_max = part("u_min", N, m), part("u_max", N, m)
        self.u_min.fill(-np.inf)
        self.u_max.fill(np.inf)
        E = part("E", N, rows, m + n)
        self.D, self.C = E[:, :, :m], E[:, :, m:]
        self.d, self.penalty, self.square = (part(name, N, rows) for name in ("d", "penalty", "square"))
        z, y = part("z", N + 1, m + n), part("y", N + 1, m + n)
        self.controls, self.states = z[:N, :m], z[:, m:]
        self.multipliers = Multipliers(y[1:, m:], part("lower", N, m), part("upper", N, m), part("force", N, rows))
        self._residuals, self.iterations, self.converged = np.zeros(4), 0, False
        self.tolerance, self.iterations_max = 1e-8, 50

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy or a pickle holds: of the arrays the memory alone, whose parts they are."""
        names = ("_sizes", "_memory", "_residuals", "iterations", "converged", "tolerance", "iterations_max")
        return {name: getattr(self, name) for name in names}

    def __setstate__(self, state: dict[str, Any]) -> None:
        Horizon.__init__(self, *state["_sizes"])
        self._memory[:] = state.pop("_memory")
        self.__dict__.update(state)
        self._residuals = self._residuals.copy()

    def relative_to(self, states: Array, controls: Array) -> None:
        """Write the same problem in differences from a reference.

        Start, dynamics, bounds, soft rows, and the states and controls with which a solve may begin change. The costs
        do not change, so write them for differences. Small differences are then not lost in the rounding of large
        numbers.

        Args:
            states, controls: Of the reference, shapes (N + 1, n) and (N, m).

        Raises:
            InputError: If an array has another shape.
        """
        N, n, m, _ = self._sizes
        given = []
        for name, value, shape in (("states", states, (N + 1, n)), ("controls", controls, (N, m))):
            array = real_array(name, value)
            if array.shape != shape:  # before a copy: a view of one number may have any shape
                raise InputError(f"{name} must have shape {shape}, got {array.shape}")
            given.append(np.ascontiguousarray(array, dtype=np.float64))
        horizon_relative_to(*self._sizes, PROCESSOR, given[0], given[1], self._memory)

    def solve(self, shifted: bool = False, warm: bool = False) -> bool:
        """Solve the problem in the arrays, and return whether the solution converged.

        Args:
            shifted: Begin with the last solution moved by one stage, for a controller that solves once per stage.
            warm: Begin with the last solution, or what is written into `states`, `controls` and `multipliers`.

        Raises:
            InputError: If an argument is not a bool.
        """
        shifted, warm = flag("shifted", shifted), flag("warm", warm)
        beginning = SHIFTED if shifted else WARM if warm else COLD
        self.iterations, self.converged = horizon_solve(
            *self._sizes, PROCESSOR, beginning, int(self.iterations_max), self.tolerance, self._memory, self._residuals
        )
        return self.converged

    @property
    def residuals(self) -> Residuals:
        """Return the residuals of the last solution."""
        return Residuals(*self._residuals.tolist())
