"""Rows of a batch on NumPy arrays: thousands at a time where that can be trusted, else one by one.

It runs the source that `rows` compiles, and the rows do not depend on each other: both give the same bits.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .codes import INACCURATE, INFEASIBLE, OPTIMAL, STEPS, TURNS, UNSURE
from .jit import compilable
from .lanes import GOOD, PROVEN, ROUNDED, S_, SHORTFALL, SUPPORT, D, cable, judge, lane_size, prepare, wrench
from .lanes_newton import newton_in_lanes, newton_size
from .lanes_slabs import reduce_lanes, slabs_in_lanes, slabs_size
from .memory import floats
from .row_alone import solve_row
from .single import work_size

__all__ = ["solve_rows", "turns_in_lanes", "uses_slabs"]

BLOCK = 4096  # rows: a vector of them fits in the processor's fastest memory


@compilable()
def uses_slabs(soft, n, m):
    """Return whether problems of this shape are solved slab after slab."""
    return soft == 0.0 and 0 <= m - n <= 2


@compilable()
def turns_in_lanes(soft, n, m):
    """Return how often the problems that are left are put together, before they are solved alone."""
    if uses_slabs(soft, n, m):
        return 1
    return TURNS if m > n or soft > 0.0 else 0


def solve_rows(
    A: Any,
    w: Any,
    lower: Any,
    upper: Any,
    ref: Any,
    weights: Any,
    length: Any,
    per: Any,
    soft: float,
    n: int,
    m: int,
    start: int,
    stop: int,
    t: Any,
    d: Any,
    info: Any,
    residual: Any,
    status: Any,
) -> None:
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
        `status` comes with UNSURE in each row to solve.
    """
    given = (A, w, lower, upper, ref, weights, length)
    answers = (t, d, info, residual, status)
    with np.errstate(all="ignore"):
        for first in range(start, stop, BLOCK):
            _solve_block(given, per, soft, n, m, first, min(first + BLOCK, stop), answers)
    unsure = start + np.flatnonzero(status[start:stop] == UNSURE)
    if not unsure.size:
        return
    views = tuple(memoryview(array) for array in given)
    equal = floats(m)
    for c in range(m):
        equal[c] = 1.0
    work, numbers = floats(work_size(n, m if soft == 0.0 else m + n)), floats(3)
    outputs = tuple(memoryview(array) for array in answers)
    for row in unsure.tolist():
        solve_row(views, per.tolist(), soft, n, m, row, equal, work, numbers, *outputs)


def _solve_block(given: Any, per: Any, soft: float, n: int, m: int, start: int, stop: int, answers: Any) -> None:
    """Solve some rows at once, and leave those that need more care unsure."""
    t, d, info, residual, status = answers
    slabs, left = uses_slabs(soft, n, m), np.arange(start, stop)
    y = np.empty((0 if slabs else n, stop - start))
    for turn in range(turns_in_lanes(soft, n, m)):
        W: list[Any] = [np.zeros(left.size)] * lane_size(n, m)
        V: list[Any] = [np.zeros(left.size)] * max(newton_size(n, m), slabs_size(n, m))
        prepare(given, per, n, m, left, False, W)
        if slabs:
            reduce_lanes(n, m, W)
            slabs_in_lanes(n, m, W, V)
        else:
            if turn > 0:
                V[:n] = y[:, left - start]
            newton_in_lanes(soft, STEPS, turn > 0, n, m, W, V)
            for i in range(n):
                y[i, left - start] = V[i]
        judge(soft > 0.0, n, m, W)
        code = np.broadcast_to(W[GOOD], left.shape).astype(np.int8)
        proven = np.broadcast_to(W[PROVEN] > 0.0, left.shape)
        if soft == 0.0:
            code[proven] = INFEASIBLE
        status[left] = code
        info[2 * left[code == INACCURATE] + 1] = np.nan
        _put(info, 2, 0, left, proven, W[SUPPORT])
        _put(info, 2, 1, left, proven, W[SHORTFALL])
        for i in range(n):
            _put(d, n, i, left, proven, W[wrench(D, n, m) + i])
        there = (code == OPTIMAL) | (code == INACCURATE)
        _put(residual, 1, 0, left, there, W[ROUNDED])
        for c in range(m):
            _put(t, m, c, left, there, W[cable(S_, m) + c])
        left = left[code == UNSURE]
        if not left.size:
            break


def _put(array: Any, each: int, offset: int, rows: Any, chosen: Any, values: Any) -> None:
    """Write the chosen values to their rows of an array, `each` numbers a row."""
    array[each * rows[chosen] + offset] = np.broadcast_to(values, rows.shape)[chosen]
