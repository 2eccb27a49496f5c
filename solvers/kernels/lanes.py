"""Many problems at once: how they lie in the work array, how they get there, and how their answers are judged.

Each row of the work array is a vector of `simd`, one lane for each problem. There are single rows, rows for each cable,
rows for each wrench row, and two matrices: S A, and B, that is S A with columns scaled to equal weights, which a solver
may overwrite. A solver reads B, the limits LOW and HIGH of s and the right-hand side Y, and leaves s in S_; wherever
it is in doubt it sets GOOD to zero, and the problem goes to `single`.
"""

from __future__ import annotations

import numpy as np

from ...base.machine_code.simd import (
    WIDTH,
    any_of,
    gather,
    load,
    magnitude,
    maximum,
    minimum,
    places,
    splat,
    sqrt,
    store,
    where,
)
from ...base.tolerances import CANCELLED, FEASIBILITY, ROUNDING, WEIGHTS_APART
from .codes import INACCURATE, OPTIMAL, SLACK, UNSURE
from .jit import compilable

# Single rows.
PER_LENGTH, REQUIRED, ROUNDED, SIZE, SLACKS, GOOD_MATRIX, GOOD, PROVEN, SUPPORT, SHORTFALL = range(10)
_SINGLE = 10
# Rows of m: limits, reference, newtons in one unit of s and the inverse, column norms; limits for s; s; basis vectors.
T_LOW, T_HIGH, REF, UNIT, PER_UNIT, NORM, LOW, HIGH, S_, N0, N1 = range(11)
_CABLE = 11
# Rows of n: S w, the right-hand side, what the reduction leaves, and the direction of a proof.
SW, Y, DIAG, TAU, D = range(5)
_WRENCH = 5
# Matrices of n m rows.
SA, B_ = range(2)
_MATRIX = 2


@compilable()
def cable(kind, m):
    """Return the first of the rows of a kind that has one for each cable."""
    return _SINGLE + kind * m


@compilable()
def wrench(kind, n, m):
    """Return the first of the rows of a kind that has one for each wrench row."""
    return _SINGLE + _CABLE * m + kind * n


@compilable()
def matrix(kind, n, m):
    """Return the first row of a matrix; its element (r, c) is r m + c rows on."""
    return _SINGLE + _CABLE * m + _WRENCH * n + kind * n * m


@compilable()
def lane_size(n, m):
    """Return how many numbers the work array has."""
    return WIDTH * (_SINGLE + _CABLE * m + _WRENCH * n + _MATRIX * n * m)


@compilable()
def _gather(source, each, size, members, W, row):
    """Put `size` numbers of each problem into rows."""
    if each == 0:
        for i in range(size):
            store(W, row + i, splat(source[i]))
        return
    starts = places(members, each)
    for i in range(size):
        store(W, row + i, gather(source, starts, i))


@compilable()
def prepare(given, per, n, m, members, keep, W):
    """Bring the problems of so many rows into lanes; with `keep`, their matrices are there already.

    `given` are the arrays of `rows.solve_rows`, from A to length.
    """
    A, w, lower, upper, ref, weights, length = given
    if not keep:
        _gather(A, per[0], n * m, members, W, matrix(SA, n, m))
        if weights.shape[0] > 0:
            _gather(weights, per[5], m, members, W, cable(UNIT, m))
        _gather(length, per[6], 1, members, W, PER_LENGTH)
        _prepare_matrix(weights.shape[0] > 0, n, m, W)
    _gather(w, per[1], n, members, W, wrench(SW, n, m))
    _gather(lower, per[2], m, members, W, cable(T_LOW, m))
    _gather(upper, per[3], m, members, W, cable(T_HIGH, m))
    _gather(ref, per[4], m, members, W, cable(REF, m))
    _prepare_limits(n, m, W)


@compilable()
def _prepare_matrix(weighted, n, m, W):
    """Scale the matrix, and its columns to equal weights."""
    length = load(W, PER_LENGTH)
    per_length = 1.0 / length
    good = (length >= 1e-20) & (length <= 1e20)
    scaled, B = matrix(SA, n, m), matrix(B_, n, m)
    if n == 6:
        for i in range(3 * m, 6 * m):
            store(W, scaled + i, load(W, scaled + i) * per_length)
    store(W, PER_LENGTH, per_length)
    unit, per_unit = cable(UNIT, m), cable(PER_UNIT, m)
    if weighted:
        heaviest, lightest = splat(0.0), splat(np.inf)
        for c in range(m):
            omega = load(W, unit + c)
            heaviest, lightest = maximum(heaviest, omega), minimum(lightest, omega)
            good = good & (omega >= 1e-20) & (omega <= 1e20)
        good = good & (heaviest <= WEIGHTS_APART * lightest)
        weighted = any_of(lightest < heaviest)
        if weighted:
            for c in range(m):
                root = sqrt(heaviest / load(W, unit + c))
                store(W, unit + c, root)
                store(W, per_unit + c, 1.0 / root)
    if not weighted:
        for c in range(m):
            store(W, unit + c, splat(1.0))
            store(W, per_unit + c, splat(1.0))
    for c in range(m):
        one = load(W, unit + c)
        square = splat(0.0)
        for r in range(n):
            x = load(W, scaled + r * m + c)
            square = square + x * x
            store(W, B + r * m + c, x * one)
        norm = sqrt(square)
        store(W, cable(NORM, m) + c, norm)
        good = good & (norm < 1e50)
    store(W, GOOD_MATRIX, where(good, splat(1.0), splat(0.0)))


@compilable()
def _prepare_limits(n, m, W):
    """State limits and right-hand side for s, and sum up what the problem requires."""
    required, per_length = splat(0.0), load(W, PER_LENGTH)
    for r in range(n):
        x = load(W, wrench(SW, n, m) + r)
        if n == 6 and r >= 3:
            x = x * per_length
        store(W, wrench(SW, n, m) + r, x)
        store(W, wrench(Y, n, m) + r, x)
        required = required + x * x
    good = (load(W, GOOD_MATRIX) > 0.0) & (required < 1e100)
    size_required, rounded, size = sqrt(required), splat(0.0), splat(0.0)
    for c in range(m):
        low, high = load(W, cable(T_LOW, m) + c), load(W, cable(T_HIGH, m) + c)
        ref, norm = load(W, cable(REF, m) + c), load(W, cable(NORM, m) + c)
        good = good & (low <= high) & (low <= 1e50) & (high >= -1e50) & (magnitude(ref) < 1e50)
        size_required = size_required + norm * magnitude(minimum(maximum(low, splat(0.0)), high))
        rounded = rounded + norm * magnitude(ref)
        per_unit = load(W, cable(PER_UNIT, m) + c)
        low, high = (low - ref) * per_unit, (high - ref) * per_unit
        store(W, cable(LOW, m) + c, low)
        store(W, cable(HIGH, m) + c, high)
        store(W, cable(S_, m) + c, splat(0.0))
        size = maximum(magnitude(minimum(maximum(low, splat(0.0)), high)), size)
        for r in range(n):
            row = wrench(Y, n, m) + r
            store(W, row, load(W, row) - load(W, matrix(SA, n, m) + r * m + c) * ref)
    store(W, REQUIRED, size_required)
    store(W, ROUNDED, rounded)
    store(W, SIZE, size)
    store(W, SLACKS, SLACK * size)
    store(W, GOOD, where(good, splat(1.0), splat(0.0)))
    for row in (PROVEN, SUPPORT, SHORTFALL):
        store(W, row, splat(0.0))
    for r in range(n):
        store(W, wrench(D, n, m) + r, splat(0.0))


@compilable()
def judge(soft, n, m, W):
    """Make tensions of s, in its rows, and judge them: their code goes to GOOD and their wrench error to ROUNDED.

    The code is optimal, with `soft` also inaccurate, else unsure; where PROVEN is one the problem is infeasible.
    """
    error, terms, rounded = splat(0.0), splat(0.0), load(W, ROUNDED)
    for c in range(m):
        x = load(W, cable(REF, m) + c) + load(W, cable(UNIT, m) + c) * load(W, cable(S_, m) + c)
        x = minimum(maximum(x, load(W, cable(T_LOW, m) + c)), load(W, cable(T_HIGH, m) + c))
        terms = terms + load(W, cable(NORM, m) + c) * magnitude(x)
        store(W, cable(S_, m) + c, x)
    for r in range(n):
        total = -load(W, wrench(SW, n, m) + r)
        for c in range(m):
            total = total + load(W, matrix(SA, n, m) + r * m + c) * load(W, cable(S_, m) + c)
        error = error + total * total
    error = sqrt(error)
    rounded = rounded + minimum(terms, CANCELLED * load(W, REQUIRED) + rounded)
    met = error <= FEASIBILITY * load(W, REQUIRED) + ROUNDING * rounded
    good = load(W, GOOD) > 0.0
    code = where(met, splat(1.0 * OPTIMAL), splat(1.0 * (INACCURATE if soft else UNSURE)))
    store(W, GOOD, where(good, code, splat(1.0 * UNSURE)))
    store(W, ROUNDED, error)
