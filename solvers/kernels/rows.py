r"""Rows of a batch: sixteen at a time where that can be trusted, else one by one."""

from __future__ import annotations

import math

import numba
import numpy as np

from ...tolerances import FEASIBILITY, ROUNDING, WEIGHTS_APART
from .codes import INACCURATE, INFEASIBLE, INVALID, OPTIMAL, UNSURE
from .jit import GIVEN, VECTOR, jit
from .lanes import lane_size, prepare, report
from .lanes_newton import newton_in_lanes, newton_size
from .lanes_slabs import reduce_lanes, slabs_in_lanes, slabs_size
from .proof import proves
from .simd import WIDTH
from .single import solve_one, what_counts, work_size

__all__ = ["solve_rows"]

# After so many steps of Newton's method the problems that are left are put together, so many times; then they go alone.
_STEPS, _TURNS = 5, 5


@jit()
def _exchange(y, start, n, members, V, keep):
    """Keep the multipliers of sixteen problems from the first rows of V, or bring them back."""
    for e in range(WIDTH):
        at = (members[e] - start) * n
        for i in range(n):
            if keep:
                y[at + i] = V[i * WIDTH + e]
            else:
                V[i * WIDTH + e] = y[at + i]


@jit()
def _is_valid(A, w, lower, upper, ref, weights, length, n, m):
    """Whether the numbers of a row are a problem, as `TensionProblem` has it."""
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


@jit()
def _alone(A, w, lower, upper, ref, weights, length, soft, n, m, t, d, info, work):
    """Solve one row, if it is a problem."""
    if not _is_valid(A, w, lower, upper, ref, weights, length, n, m):
        return INVALID
    if soft == 0.0:
        return solve_one(A, w, lower, upper, ref, weights, length, n, m, t, d, info, work)
    return _alone_soft(A, w, lower, upper, ref, weights, length, soft, n, m, t, d, info, work)


@jit()
def _alone_soft(A, w, lower, upper, ref, weights, length, soft, n, m, t, d, info, work):
    """Solve one row with the missing wrench S^-1 e as n more tensions, of weight rho and without limits."""
    mm = m + n
    heaviest = weights.max()
    matrix, x, e, about = np.zeros(n * mm), np.empty(mm), np.empty(n), np.empty(3)
    low, high, at, omega = np.empty(mm), np.empty(mm), np.empty(mm), np.empty(mm)
    low[:m], high[:m], at[:m], omega[:m] = lower, upper, ref, weights / heaviest
    low[m:], high[m:], at[m:], omega[m:] = -np.inf, np.inf, 0.0, 1.0 / soft
    for i in range(n):
        matrix[i * mm : i * mm + m] = A[i * m : i * m + m]
        matrix[i * mm + m + i] = length if n == 6 and i >= 3 else 1.0
    if solve_one(matrix, w, low, high, at, omega, length, n, mm, x, e, about, work) != OPTIMAL:
        return UNSURE
    t[:] = x[:m]
    e[:] = x[m:]
    total = 0.0
    for i in range(n):
        missing = w[i]
        for c in range(m):
            missing -= A[i * m + c] * t[c]
        missing /= length if n == 6 and i >= 3 else 1.0
        total += missing * missing
    info[2] = math.sqrt(total)
    asked, rounded = what_counts(A, w, lower, upper, ref, t, length, n, m)
    if info[2] <= FEASIBILITY * asked + ROUNDING * rounded:
        return OPTIMAL
    if proves(A, w, lower, upper, ref, n, m, 1.0 / length, e, info) == INFEASIBLE:
        d[:] = e
    else:
        info[:2] = np.nan
    return INACCURATE


@jit(
    numba.void(
        *[GIVEN] * 7,
        numba.types.Array(numba.int64, 1, "C", readonly=True),
        numba.float64,
        *[numba.int64] * 4,
        *[VECTOR] * 4,
        numba.types.Array(numba.int8, 1, "C"),
    )
)
def solve_rows(A, w, lower, upper, ref, weights, length, per, soft, n, m, start, stop, t, d, info, residual, status):
    """Solve the rows start to stop of a batch.

    Parameters
    ----------
    A, w, lower, upper, ref, weights, length :
        As in `solve_packed`, all rows one after another. An empty `weights` stands for equal ones.
    soft :
        1 / rho, the price of a squared wrench error beside squared tensions; 0 if the wrench must be met.
    per :
        Shape (7,): numbers per row of each of these, 0 where one row serves all.
    t, d, info, residual, status :
        Get tensions (rows * m) and wrench errors (rows) where there are any; directions (rows * n), support and
        shortfall (rows * 2) where the status is not OPTIMAL, nan in the shortfall without proof; and codes (rows).
        `status` comes with UNSURE in each row to solve.
    """
    equal = np.ones(m)
    work = np.empty(work_size(n, m if soft == 0.0 else m + n))
    W, V = np.ones(lane_size(n, m)), np.empty(max(newton_size(n, m), slabs_size(n, m)))
    given = (A, w, lower, upper, ref, weights, length)
    members = np.empty(WIDTH, np.int64)
    numbers = np.empty(3)
    shared = per[0] == 0 and per[5] == 0 and per[6] == 0
    slabs = soft == 0.0 and 0 <= m - n <= 2
    left = np.arange(start, stop)
    y = np.empty(0 if slabs else (stop - start) * n)
    turns = 1 if slabs else _TURNS if m > n or soft > 0.0 else 0
    for turn in range(turns):
        for first in range(0, left.size, WIDTH):
            for e in range(WIDTH):  # a last few are completed by repeating the last one
                members[e] = left[min(first + e, left.size - 1)]
            keep = shared and first > 0
            prepare(given, per, n, m, members, keep, W)
            if slabs:
                if not keep:
                    reduce_lanes(n, m, W)
                slabs_in_lanes(n, m, W, V)
            else:
                if turn > 0:
                    _exchange(y, start, n, members, V, False)
                newton_in_lanes(soft, _STEPS, turn > 0, n, m, W, V)
                _exchange(y, start, n, members, V, True)
            report(soft > 0.0, n, m, members, W, t, d, info, residual, status)
        left = left[status[left] == UNSURE]
    for row in range(start, stop):
        if status[row] == UNSURE:
            numbers[:] = np.nan
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
