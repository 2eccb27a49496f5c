"""towline as a solver of the qpsolvers package, so that qpbenchmark can run it among the others.

qpsolvers has no hook for solvers of other packages: `register` writes into its tables. A bounded QP with a diagonal
cost and equations is a tension problem,

    min 1/2 x' P x + q' x   s.t.  A x = b,  lb <= x <= ub      (P diagonal: weights P_ii, t_ref = -q_i / P_ii)

and what qpbenchmark wants besides x are the multipliers y and z_box of P x + q + A' y + z_box = 0.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ..solvers import TensionProblem, solve
from ..solvers.box_least_squares import box_least_squares

if TYPE_CHECKING:
    import qpsolvers

NAME = "towline"

Array = NDArray[np.float64]

# A variable this near to a limit may have a multiplier there, relative to its size or to 1.
_AT_LIMIT = 1e-11

# Singular values below this part of the largest are zero in the search for multipliers, the coarsest first: small
# multipliers have small rounding errors, and where a fine cut is not needed it only adds noise times a huge number.
_CUTS = (1e-6, 1e-9, 1e-15)
_GOOD = 1e-12

# Equations with a singular value below this part of the largest are tried without, see `solve_problem`.
_DEPENDENT = 1e-8


def register() -> None:
    """Make qpsolvers and, if it is installed, qpbenchmark know the solver "towline"; a second call changes nothing."""
    import qpsolvers
    from qpsolvers import solvers

    if NAME in qpsolvers.available_solvers:
        return
    solvers.solve_function[NAME] = solve_problem
    qpsolvers.available_solvers.append(NAME)
    qpsolvers.dense_solvers.append(NAME)
    try:
        from qpbenchmark.solver_settings import SolverSettings
    except ImportError:
        pass
    else:
        SolverSettings.IMPLEMENTED_SOLVERS.add(NAME)
    # What is imported or compiled at the first call is no part of solving.
    tug = qpsolvers.Problem(np.eye(2), np.zeros(2), A=np.ones((1, 2)), b=np.ones(1), lb=np.zeros(2), ub=np.ones(2))
    solve_problem(tug)


def solve_problem(
    problem: qpsolvers.Problem,
    initvals: Array | None = None,
    verbose: bool = False,
    eps_abs: float = 1e-9,
    method: str = "active-set",
) -> qpsolvers.Solution:
    """Solve a QP with diagonal cost, equations and limits; the signature is as qpsolvers' back ends have it.

    - `problem`: the QP; sparse matrices are made dense. `initvals`, `verbose`: not used.
    - `eps_abs`: residuals and duality gap that are good enough. It matters only where the equations are nearly
      dependent: then those that equal 0 = 0 within the tolerance are left out, if the result meets the original QP to
      `eps_abs`.
    - `method`: one of `towline.solvers.methods()` that ends at the optimum.

    Raises `InputError` if the QP has inequality rows, a cost matrix that is not diagonal and positive, or no equations.
    """
    import qpsolvers

    P, q, G, _, A, b, lb, ub = problem.unpack_as_dense()
    weights = np.diagonal(P)
    if G is not None or A is None or b is None or (np.diag(weights) != P).any() or not (weights > 0).all():
        raise InputError("problem must have a positive diagonal P, equations A x = b and no G, got another form")
    lower = np.full(q.size, -np.inf) if lb is None else lb
    upper = np.full(q.size, np.inf) if ub is None else ub
    solution = qpsolvers.Solution(problem)
    for rows, right in _equations(A, b):
        answer = solve(TensionProblem(rows, right, lower, upper, t_ref=-q / weights, weights=weights), method=method)
        solution.found = answer.feasible
        solution.extras = {"status": answer.status.value}
        if answer.tensions is None or not answer.feasible:
            continue
        x = answer.tensions.copy()
        solution.x, solution.z = x, np.zeros(0)
        solution.y, solution.z_box = multipliers(weights * x + q, rows, right, x, lower, upper)
        solution.obj = float(0.5 * x @ (weights * x) + q @ x)
        if solution.is_optimal(eps_abs):
            break
    return solution


def _equations(A: Array, b: Array) -> list[tuple[Array, Array]]:
    """Return the equations A x = b, preceded by those without the nearly dependent ones if there are any."""
    U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
    rank = int(np.count_nonzero(sigma > _DEPENDENT * sigma[0]))
    if rank in (0, sigma.size):
        return [(A, b)]
    basis = U[:, :rank]
    return [((basis * sigma[:rank]) @ Vt[:rank], basis @ (basis.T @ b)), (A, b)]


def multipliers(gradient: Array, A: Array, b: Array, x: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the multipliers of the equations and the limits at an optimum x (n,), y (rows,) and z_box (n,).

    `gradient` is P x + q. The entries of z_box are negative at lower limits and positive at upper ones.
    The variables between their limits determine y by least squares, as long as the signs that it gives at the limits
    are right. At a degenerate vertex they need not be, since too few variables are between: then y and z_box
    are computed together, under the signs that the limits allow.
    """
    near = _AT_LIMIT * np.maximum(1.0, np.abs(x))
    at_lower, at_upper = x <= lower + near, x >= upper - near
    inside = ~(at_lower | at_upper)

    def candidate(y: Array) -> tuple[float, Array, Array]:
        """Return the error of multipliers, and them."""
        z = -(gradient + y @ A)
        z = np.where(at_upper, np.maximum(z, 0.0), 0.0) + np.where(at_lower, np.minimum(z, 0.0), 0.0)
        gap = gradient @ x + b @ y + z[z < 0] @ lower[z < 0] + z[z > 0] @ upper[z > 0]
        return max(float(np.abs(gradient + y @ A + z).max()), abs(float(gap))), y, z

    candidates: list[tuple[float, Array, Array]] = []
    for cut in _CUTS:
        y = np.asarray(np.linalg.lstsq(A[:, inside].T, -gradient[inside], rcond=cut)[0], dtype=np.float64)
        candidates.append(candidate(y))
        if candidates[-1][0] <= _GOOD:
            return candidates[-1][1:]
    rows = A.shape[0]
    M = np.hstack([A.T, np.eye(x.size)[:, ~inside]])
    free = np.full(rows, np.inf)
    low = np.concatenate([-free, np.where(at_lower, -np.inf, 0.0)[~inside]])
    high = np.concatenate([free, np.where(at_upper, np.inf, 0.0)[~inside]])
    both, _ = box_least_squares(M, -gradient, low, high)
    return min([*candidates, candidate(both[:rows])], key=lambda each: each[0])[1:]


def as_qp(problem: TensionProblem) -> dict[str, Any]:
    """Return a tension problem as the arguments P, q, A, b, lb, ub of a QP, in units of its largest finite limit.

    Moment rows are divided by the problem's length and rows of zeros are left out: absolute tolerances, the only ones
    that solvers share, then mean a part of the largest tension.
    """
    limits = np.abs(np.concatenate([problem.t_min, problem.t_max]))
    unit = float(limits[np.isfinite(limits)].max(initial=0.0))
    if unit == 0.0:
        raise InputError("problem must have a finite limit other than 0, which gives the unit, got none")
    rows = np.flatnonzero(problem.scaled_A.any(axis=1) | (problem.scaled_w != 0.0))
    relative = problem.weights / problem.weights.min()  # a gradient error is then no more than such a tension error
    return {
        "P": np.diag(relative),
        "q": -relative * problem.t_ref / unit,
        "A": problem.scaled_A[rows],
        "b": problem.scaled_w[rows] / unit,
        "lb": problem.t_min / unit,
        "ub": problem.t_max / unit,
    }
