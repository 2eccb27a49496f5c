"""Rows of a batch as machine code: sixteen at a time where that can be trusted, else one by one. See `wide`."""

from __future__ import annotations

import numpy as np

from .codes import INACCURATE, INFEASIBLE, OPTIMAL, STEPS, UNSURE
from .jit import GIVEN, VECTOR, compilable
from .lanes import GOOD, PROVEN, ROUNDED, S_, SHORTFALL, SUPPORT, D, cable, judge, lane_size, prepare, wrench
from .lanes_newton import newton_in_lanes, newton_size
from .lanes_slabs import reduce_lanes, slabs_in_lanes, slabs_size
from .memory import floats, integers
from .row_alone import solve_row
from .simd import WIDTH
from .single import work_size
from .wide import turns_in_lanes, uses_slabs

__all__ = ["solve_rows"]


@compilable()
def _exchange(y, start, n, members, V, keep):
    """Keep the multipliers of sixteen problems from the first rows of V, or bring them back."""
    for e in range(WIDTH):
        at = (members[e] - start) * n
        for i in range(n):
            if keep:
                y[at + i] = V[i * WIDTH + e]
            else:
                V[i * WIDTH + e] = y[at + i]


@compilable()
def _hand_out(soft, n, m, members, W, t, d, info, residual, status):
    """Copy sixteen answers to where they belong."""
    for e in range(WIDTH):
        row = members[e]
        proven = W[PROVEN * WIDTH + e] > 0.0
        status[row] = INFEASIBLE if proven and not soft else int(W[GOOD * WIDTH + e])
        if proven:
            info[row * 2], info[row * 2 + 1] = W[SUPPORT * WIDTH + e], W[SHORTFALL * WIDTH + e]
            for i in range(n):
                d[row * n + i] = W[(wrench(D, n, m) + i) * WIDTH + e]
        elif status[row] == INACCURATE:
            info[row * 2], info[row * 2 + 1] = np.nan, np.nan
        if status[row] == OPTIMAL or status[row] == INACCURATE:
            residual[row] = W[ROUNDED * WIDTH + e]
            for c in range(m):
                t[row * m + c] = W[(cable(S_, m) + c) * WIDTH + e]


@compilable(
    "void",
    *[GIVEN] * 7,
    "Array(int64, 1, 'C', readonly=True)",
    "float64",
    *["int64"] * 4,
    *[VECTOR] * 4,
    "Array(int8, 1, 'C')",
)
def solve_rows(A, w, lower, upper, ref, weights, length, per, soft, n, m, start, stop, t, d, info, residual, status):
    """Solve the rows start to stop of a batch; the arguments are those of `wide.solve_rows`."""
    equal = floats(m)
    for c in range(m):
        equal[c] = 1.0
    work, numbers = floats(work_size(n, m if soft == 0.0 else m + n)), floats(3)
    W, V = floats(lane_size(n, m)), floats(max(newton_size(n, m), slabs_size(n, m)))
    given = (A, w, lower, upper, ref, weights, length)
    members = integers(WIDTH)
    shared = per[0] == 0 and per[5] == 0 and per[6] == 0
    slabs = uses_slabs(soft, n, m)
    left = np.arange(start, stop)
    y = floats(0 if slabs else (stop - start) * n)
    for turn in range(turns_in_lanes(soft, n, m)):
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
                newton_in_lanes(soft, STEPS, turn > 0, n, m, W, V)
                _exchange(y, start, n, members, V, True)
            judge(soft > 0.0, n, m, W)
            _hand_out(soft > 0.0, n, m, members, W, t, d, info, residual, status)
        left = left[status[left] == UNSURE]
    for row in range(start, stop):
        if status[row] == UNSURE:
            solve_row(given, per, soft, n, m, row, equal, work, numbers, t, d, info, residual, status)
