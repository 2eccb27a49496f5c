"""Least squares in the box of the tension limits: min |M x - b| subject to lower <= x <= upper.

`box_least_squares` is bounded-variable least squares (Stark and Parker 1995), as Lawson and Hanson arrange it: every
variable starts at the value inside its limits nearest to zero and is freed one at a time. A variable is freed only if
its column is not in the span of the free ones (it has a part along the residual, which is orthogonal to that span), so
rank-deficient matrices and duplicate columns need no special care, infinite limits neither.

`project` finds with it the available wrench that is nearest to w.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.tolerances import RANK
from .problem import Array, TensionProblem

# Rounding of a gradient entry, relative to the sum of the absolute terms in it.
_NOISE = 4e-15

# A cable whose column has a larger part than this along the residual, relative to both, is at a limit.
_STILL = 1e-5

# A residual that is shorter than this, relative to w, is rounding: no other number is so near to w.
_NOTHING = 1e-20


class Projection(NamedTuple):
    """The projection of w on the available wrench set, in newtons (moments divided by the problem's length)."""

    # Tensions inside the limits whose wrench is nearest to w [N], shape (m,). The wrench is unique, they need not be.
    closest: Array
    # The remaining error of the wrench, S (w - A closest) [N], shape (n,), orthogonal to the last digit to every cable
    # that is not at a limit. It has that accuracy relative to its own length, however short it is compared with w.
    residual: Array


def box_least_squares(M: Array, b: Array, lower: Array, upper: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Minimise |M x - b| over a box.

    - `M`: matrix, shape (k, m), any rank.
    - `b`: right-hand side, shape (k,).
    - `lower`, `upper`: limits, shape (m,), may be infinite or equal.

    Returns a minimiser, shape (m,), exactly inside the limits. Where it is not unique, the first one reached.
    With it comes a mask, shape (m,), of the variables that the minimisation determined, whose columns are linearly
    independent.
    """
    m = M.shape[1]
    norms = np.sqrt(np.einsum("ij,ij->j", M, M))
    per_unit = 1.0 / np.where(norms > 0, norms, 1.0)
    x = np.minimum(np.maximum(lower, 0.0), upper)
    free = np.zeros(m, dtype=bool)
    banned = np.zeros(m, dtype=bool)
    # Each pass lowers the residual, so no set of free variables comes back; the cap is for rounding gone wrong.
    for _ in range(20 * m + 20):
        residual = b - M @ x
        gradient = M.T @ residual
        noise = _NOISE * norms * (np.sqrt(b @ b) + norms @ np.abs(x))
        wants_up = (gradient > noise) & (x < upper)
        wants_down = (gradient < -noise) & (x > lower)
        gain = np.where((wants_up | wants_down) & ~free & ~banned, np.abs(gradient) * per_unit, 0.0)
        if not gain.any():
            break
        entering = int(np.argmax(gain))
        x_before, free_before = x.copy(), free.copy()
        free[entering] = True
        _settle(M, b, lower, upper, x, free)
        change = M @ (x - x_before)
        # |residual before|^2 - |residual after|^2, in a form that keeps its digits when they are nearly equal.
        if (x[entering] - x_before[entering]) * gradient[entering] > 0.0 and change @ (2 * residual - change) > 0.0:
            banned[:] = False
        else:
            # Rounding decided that this one should enter. Undo, and leave it out until something else has moved.
            x, free = x_before, free_before
            banned[entering] = True
    return x, free


def _settle(M: Array, b: Array, lower: Array, upper: Array, x: Array, free: NDArray[np.bool_]) -> None:
    """Minimise over the free variables, in place; those that meet a limit stop there and leave `free`."""
    while free.any():
        index = np.flatnonzero(free)
        held = np.where(free, 0.0, x)
        target = np.linalg.lstsq(M[:, index], b - M @ held, rcond=None)[0]
        start, low, high = x[index], lower[index], upper[index]
        beyond = (target < low) | (target > high)
        if not beyond.any():
            x[index] = target
            return
        step = target - start
        limit = np.where(step > 0, high, low)
        with np.errstate(divide="ignore", invalid="ignore"):
            fraction = np.where(beyond, (limit - start) / step, np.inf)
        shortest = max(float(fraction.min()), 0.0)
        x[index] = np.minimum(np.maximum(start + shortest * step, low), high)
        stopped = fraction <= shortest
        x[index[stopped]] = limit[stopped]
        free[index[stopped]] = False


def project(problem: TensionProblem) -> Projection:
    """Project w on the available wrench set."""
    M, residual = problem.scaled_A, problem.scaled_w
    closest = np.zeros(problem.m)
    # Rounding is relative to w, and a short residual has lost the digits that make its direction. Projecting what is
    # left, from where we stand, brings them back, until it is so short that w is in the set.
    nothing = _NOTHING**2 * (residual @ residual)
    for _ in range(4):
        given = residual
        step, _ = box_least_squares(M, given, problem.t_min - closest, problem.t_max - closest)
        closest = np.minimum(np.maximum(closest + step, problem.t_min), problem.t_max)
        residual = given - M @ step
        left = residual @ residual
        if left > 1e-2 * (given @ given) or left <= nothing:
            break
    # A cable that is not at a limit has no part along the residual, but for rounding. One that has is at its limit, and
    # only rounding puts it inside.
    still = np.abs(residual @ M) <= _STILL * problem.column_norms * np.sqrt(residual @ residual)
    inside = (closest > problem.t_min) & (closest < problem.t_max) & still
    return Projection(closest, _orthogonal_part(residual, M[:, inside]))


def _orthogonal_part(vector: Array, columns: Array) -> Array:
    """Remove from `vector` its parts in the range of `columns`; twice, since once is not enough if little is left."""
    U, sigma, _ = np.linalg.svd(columns, full_matrices=False)
    U = U[:, sigma > RANK * sigma.max(initial=0.0)]
    for _ in range(2):
        vector = vector - U @ (U.T @ vector)
    return vector
