"""Rows of a batch, many at a time; where that cannot be trusted they stay unsure.

As plain Python a vector has thousands of rows, as machine code sixteen; see `simd`. The rows do not depend on each
other, so both give the same bits.
"""

from __future__ import annotations

import numpy as np

from ...base.machine_code.simd import (
    TOGETHER,
    WIDTH,
    any_of,
    gather,
    load,
    places,
    scatter,
    splat,
    store,
    vectors,
    where,
)
from .codes import INFEASIBLE, OPTIMAL, STEPS, TURNS, UNSURE
from .jit import GIVEN, VECTOR, compilable
from .lanes import GOOD, PROVEN, ROUNDED, S_, SHORTFALL, SUPPORT, D, cable, judge, lane_size, prepare, wrench
from .lanes_newton import newton_in_lanes, newton_size
from .lanes_slabs import reduce_lanes, slabs_in_lanes, slabs_size

__all__ = ["solve_rows"]


@compilable()
def _solve_together(given, per, soft, slabs, n, m, members, turn, keep, start, y, W, V, t, d, info, residual, status):
    """Solve the rows `members`, and leave those that need more care unsure; `keep` if W has their matrix already.

    y, n numbers for each row from `start`, keeps multipliers from one turn to the next.
    """
    prepare(given, per, n, m, members, keep, W)
    by_wrench = places(members, n)
    if slabs:
        if not keep:
            reduce_lanes(n, m, W)
        slabs_in_lanes(n, m, W, V)
    else:
        if turn > 0:
            for i in range(n):
                store(V, i, gather(y, by_wrench, i - start * n))
        newton_in_lanes(soft, STEPS, turn > 0, n, m, W, V)
        for i in range(n):
            scatter(y, by_wrench, i - start * n, load(V, i))
    judge(soft > 0.0, n, m, W)
    code, proven = load(W, GOOD), load(W, PROVEN) > 0.0
    by_row, by_two, by_cable = places(members, 1), places(members, 2), places(members, m)
    if soft == 0.0:
        code = where(proven, splat(1.0 * INFEASIBLE), code)
    scatter(status, by_row, 0, code)
    any_proven = any_of(proven)
    if any_proven or soft > 0.0:
        scatter(info, by_two, 1, where(proven, load(W, SHORTFALL), splat(np.nan)))
    if any_proven:
        scatter(info, by_two, 0, load(W, SUPPORT))
        for i in range(n):
            scatter(d, by_wrench, i, load(W, wrench(D, n, m) + i))
    if soft > 0.0 or any_of(code <= 1.0 * OPTIMAL):
        scatter(residual, by_row, 0, load(W, ROUNDED))
        for c in range(m):
            scatter(t, by_cable, c, load(W, cable(S_, m) + c))


@compilable(
    *("void", *[GIVEN] * 7, "Array(int64, 1, 'C', readonly=True)", "float64", *["int64"] * 4, *[VECTOR] * 5),
)
def solve_rows(A, w, lower, upper, ref, weights, length, per, soft, n, m, start, stop, t, d, info, residual, status):
    """Solve the rows start to stop of a batch.

    Parameters
    ----------
    A, w, lower, upper, ref, weights, length :
        As in `single.solve_packed`, all rows one after another. An empty `weights` stands for equal ones.
    per :
        Shape (7,): numbers per row of each of these, 0 where one row serves all.
    soft :
        1 / rho, the price of a squared wrench error beside squared tensions; 0 if the wrench must be met.
    n, m :
        Wrench rows and cables.
    t, d, info, residual, status :
        Get tensions (rows * m) and wrench errors (rows) where there are any; directions (rows * n), support and
        shortfall (rows * 2) where the status is not OPTIMAL, nan in the shortfall without proof; and codes (rows).
        `status` comes with UNSURE in each row to solve. Elsewhere they get numbers that mean nothing.
    """
    given = (A, w, lower, upper, ref, weights, length)
    W, V = vectors(lane_size(n, m)), vectors(max(newton_size(n, m), slabs_size(n, m)))
    shared = per[0] == 0 and per[5] == 0 and per[6] == 0
    slabs = soft == 0.0 and 0 <= m - n <= 2
    # How often the problems that are left are put together.
    turns = 1 if slabs else TURNS if m > n or soft > 0.0 else 0
    left = np.arange(start, stop)
    y = np.zeros(0 if slabs else (stop - start) * n)
    for turn in range(turns):
        for first in range(0, left.size, TOGETHER):
            members = left[first : first + TOGETHER]
            if members.size % WIDTH:  # the last lanes repeat the last row
                members = np.concatenate((members, np.repeat(members[-1:], WIDTH - members.size % WIDTH)))
            keep = shared and first > 0
            _solve_together(
                given, per, soft, slabs, n, m, members, turn, keep, start, y, W, V, t, d, info, residual, status
            )
        left = left[status[left] == UNSURE]
