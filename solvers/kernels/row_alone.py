"""One row of a batch, alone: whether it is a problem, and its solution by the scalar kernel."""

from __future__ import annotations

import math

import numpy as np

from ...tolerances import FEASIBILITY, ROUNDING, WEIGHTS_APART
from .codes import INACCURATE, INFEASIBLE, INVALID, OPTIMAL, UNSURE
from .jit import compilable
from .memory import floats
from .proof import proves
from .single import solve_one, what_counts

__all__ = ["solve_row"]


@compilable()
def _is_valid(A, w, lower, upper, ref, weights, length, n, m):
    """Return whether the numbers of a row are a problem, as `TensionProblem` has it."""
    if not 1e-20 <= length <= 1e20:
        return False
    for i in range(n * m):
        if not abs(A[i]) < 1e50:
            return False
    for i in range(n):
        if not abs(w[i]) < 1e50:
            return False
    heaviest, lightest = 0.0, np.inf
    for c in range(m):
        if not (lower[c] <= 1e50 and upper[c] >= -1e50 and lower[c] <= upper[c]):
            return False
        if not (abs(ref[c]) < 1e50 and 1e-20 <= weights[c] <= 1e20):
            return False
        heaviest, lightest = max(heaviest, weights[c]), min(lightest, weights[c])
    return heaviest <= WEIGHTS_APART * lightest


@compilable()
def _alone(A, w, lower, upper, ref, weights, length, soft, n, m, t, d, info, work):
    """Solve one row, if it is a problem."""
    if not _is_valid(A, w, lower, upper, ref, weights, length, n, m):
        return INVALID
    if soft == 0.0:
        return solve_one(A, w, lower, upper, ref, weights, length, n, m, t, d, info, work)
    return _soft(A, w, lower, upper, ref, weights, length, soft, n, m, t, d, info, work)


@compilable()
def _soft(A, w, lower, upper, ref, weights, length, soft, n, m, t, d, info, work):
    """Solve one row with the missing wrench S^-1 e as n more tensions, of weight rho and without limits."""
    mm = m + n
    heaviest = 0.0
    for c in range(m):
        heaviest = max(heaviest, weights[c])
    matrix, x, e, about = floats(n * mm), floats(mm), floats(n), floats(3)
    low, high, at, omega = floats(mm), floats(mm), floats(mm), floats(mm)
    for c in range(m):
        low[c], high[c], at[c], omega[c] = lower[c], upper[c], ref[c], weights[c] / heaviest
    for c in range(m, mm):
        low[c], high[c], omega[c] = -np.inf, np.inf, 1.0 / soft
    for i in range(n):
        for c in range(m):
            matrix[i * mm + c] = A[i * m + c]
        matrix[i * mm + m + i] = length if n == 6 and i >= 3 else 1.0
    if solve_one(matrix, w, low, high, at, omega, length, n, mm, x, e, about, work) != OPTIMAL:
        return UNSURE
    for c in range(m):
        t[c] = x[c]
    for i in range(n):
        e[i] = x[m + i]
    total = 0.0
    for i in range(n):
        missing = w[i]
        for c in range(m):
            missing -= A[i * m + c] * t[c]
        missing /= length if n == 6 and i >= 3 else 1.0
        total += missing * missing
    info[2] = math.sqrt(total)
    required, rounding, largest = what_counts(A, w, lower, upper, ref, t, length, n, m)
    if info[2] <= FEASIBILITY * required + ROUNDING * rounding:
        return OPTIMAL
    if proves(A, w, lower, upper, n, m, 1.0 / length, required, rounding, largest, e, info) == INFEASIBLE:
        for i in range(n):
            d[i] = e[i]
    else:
        info[0], info[1] = np.nan, np.nan
    return INACCURATE


@compilable()
def solve_row(given, per, soft, n, m, row, equal, work, numbers, answers):
    """Solve one row; `given` and `answers` are those of `rows.solve_rows`, `equal` (m,) are weights for want of any."""
    A, w, lower, upper, ref, weights, length = given
    t, d, info, residual, status = answers
    numbers[0], numbers[1], numbers[2] = np.nan, np.nan, np.nan
    status[row] = _alone(
        A[row * per[0] : row * per[0] + n * m],
        w[row * per[1] : row * per[1] + n],
        lower[row * per[2] : row * per[2] + m],
        upper[row * per[3] : row * per[3] + m],
        ref[row * per[4] : row * per[4] + m],
        weights[row * per[5] : row * per[5] + m] if weights.shape[0] > 0 else equal,
        length[row * per[6]],
        soft,
        n,
        m,
        t[row * m : row * m + m],
        d[row * n : row * n + n],
        numbers,
        work,
    )
    info[row * 2], info[row * 2 + 1], residual[row] = numbers[0], numbers[1], numbers[2]
