r"""Derivatives of the optimal tensions: `sensitivity` to the wrench, and `derivatives` by all data.

With the cables H held at their limits and the others, F, free, the optimum is weighted least squares,

$$
t_F = t_{ref,F} + W_F^{-1} A_F^T y, \qquad A_F t_F = w - A_H t_H
\quad \Rightarrow \quad
\frac{dt_F}{dw} = W_F^{-1/2} (S A_F W_F^{-1/2})^+ S, \qquad \frac{dt_H}{dw} = 0
$$

and the derivative with respect to A follows from that of the pseudo-inverse (Golub and Pereyra 1973).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.inputs import InputError, required
from .problem import Array, TensionProblem
from .solution import TensionSolution

# A tension this near to its limit, relative to the largest tension, is at it; a multiplier this small, relative to the
# largest gradient of the cost, does not hold it there. Singular values this small count as zero.
_AT_LIMIT = 1e-9
_HOLDS = 1e-9
_RANK = 1e-9


class Derivatives(NamedTuple):
    """Derivatives of the optimal tensions, each with the dimensions of its variable last."""

    w: Array  # dt / dw, shape (m, n)
    # dt / dt_min and dt / dt_max, shape (m, m): columns of free cables are 0. Cables with equal limits count for t_min.
    t_min: Array
    t_max: Array
    A: Array  # dt / dA, shape (m, n, m)


def sensitivity(problem: TensionProblem, solution: TensionSolution) -> Array:
    """Return dt/dw of the bounded least squares at its active set.

    Args:
        problem: The problem.
        solution: Its solution by a method that solves the quadratic program ("active-set", "min-norm" without
            `lambda_`, "qp", "2-norm", "dykstra").

    Returns:
        dt_i / dw_j, shape (m, n) [N per N, N per N m]. The tensions are piecewise linear in w. Where pieces meet (a
        cable is at its limit but nothing holds it there) the result is one-sided, for the piece on which such
            cables are free. It is 0 in directions of w that the free cables cannot give: there the active set changes
            at once (where pieces meet), or no tensions exist (on the boundary of the available wrench set).

    Raises:
        InputError: If an argument has a wrong type, or the solution has no tensions, or another number of cables.
    """
    tensions = required("solution", solution, TensionSolution).tensions
    if tensions is None:
        raise InputError(f"solution must be one with tensions, got status {solution.status}")
    if tensions.size != required("problem", problem, TensionProblem).m:
        raise InputError(
            f"solution must have {problem.m} tensions, one for each cable of the problem, got {tensions.size}"
        )
    return derivatives(problem, tensions).w


def derivatives(problem: TensionProblem, tensions: Array) -> Derivatives:
    """Return the derivatives of the optimum with respect to wrench, limits and wrench matrix.

    The notes of `sensitivity` on kinks hold for all. The tensions may also be those of "soft-wrench" for a w out of
    reach.

    Args:
        problem: The problem.
        tensions: Its optimal tensions [N], shape (m,).
    """
    m, n = problem.m, problem.n
    low, high, free = _active_set(problem, tensions)
    scale = problem.row_scale
    root = 1.0 / np.sqrt(problem.weights[free])  # (f,), W^(-1/2)
    B = problem.scaled_A[:, free] * root  # (n, f)
    inverse = np.linalg.pinv(B, rcond=_RANK)  # (f, n)
    P = root[:, None] * inverse * scale  # (f, n), dt_F / dw

    by_w = np.zeros((m, n))
    by_w[free] = P
    by_min, by_max = np.zeros((m, m)), np.zeros((m, m))
    for by_limit, held in ((by_min, low), (by_max, high)):
        by_limit[np.ix_(free, held)] = -P @ problem.A[:, held]
        by_limit[held, held] = 1.0

    # With t_F = t_ref + W^-1 (S A_F)^T y and the wrench error e = S (A t - w), orthogonal to the range of B.
    y = np.linalg.lstsq(B.T, (tensions - problem.t_ref)[free] / root, rcond=_RANK)[0]
    error = problem.scaled_A @ tensions - problem.scaled_w
    error = error - B @ (inverse @ error)
    along = root[:, None] * (np.eye(int(free.sum())) - inverse @ B)  # (f, f)
    curvature = root[:, None] * (inverse @ inverse.T)  # (f, f)
    by_A = np.zeros((m, n, m))
    by_A[free] = -P[:, :, None] * tensions
    in_range, off_range = (along * root)[:, None, :], (curvature * root)[:, None, :]  # (f, 1, f)
    spread = in_range * (scale * y)[:, None] - off_range * (scale * error)[:, None]
    by_A[np.ix_(free, np.ones(n, dtype=bool), free)] += spread
    return Derivatives(by_w, by_min, by_max, by_A)


def _active_set(problem: TensionProblem, tensions: Array) -> tuple[NDArray[np.bool_], ...]:
    """Return masks of the cables held at t_min, held at t_max, and free."""
    near = _AT_LIMIT * np.abs(tensions).max(initial=0.0)
    fixed = problem.t_min == problem.t_max
    at_low, at_high = tensions - problem.t_min <= near, problem.t_max - tensions <= near
    pull = problem.weights * (tensions - problem.t_ref)
    inside = ~(at_low | at_high)
    # Multipliers: what the wrench's price y leaves of the cost's gradient. With few free cables y is not unique, and
    # the largest set of cables that some y would release is one-sided in the sense of `sensitivity`.
    price = np.linalg.lstsq(problem.scaled_A[:, inside].T, pull[inside], rcond=_RANK)[0]
    error = problem.scaled_A @ tensions - problem.scaled_w
    rest = pull - problem.scaled_A.T @ price
    if np.sqrt(error @ error) > problem.tolerance(tensions):
        # Out of reach it is the wrench error that holds the cables.
        rest = problem.scaled_A.T @ error
    weak = _HOLDS * max(np.abs(pull).max(initial=0.0), np.abs(rest).max(initial=0.0))
    low = fixed | (at_low & (rest > weak))
    high = ~fixed & at_high & (rest < -weak)
    return low, high, ~(low | high)
