r"""Many problems at once with any number of cables: Newton's method on the dual.

The dual of the bounded least norm has one unknown for each equation: with multipliers y the best s is
$s(y) = clip(B^T y)$, and y is right where

$$ r(y) = b - B s(y) - y / \rho = 0, $$

the gradient of a concave, piecewise quadratic function (1/rho is 0 where the wrench must be met). Newton's steps with
$H = B_F B_F^T + 1/\rho$, F the cables between their limits, end after as many as it takes to find F: three, most
often. A step that goes too far is shortened to the best place on its way, by Newton again, in one dimension. Where the
wrench is out of reach the dual has no maximum, and y, the step or r are soon directions that prove it. Whatever is not
decided in a few steps, or rests on a pivot that is nearly zero, goes to `single`.
"""

from __future__ import annotations

import numpy as np

from ...base.machine_code.simd import WIDTH, any_of, load, magnitude, maximum, minimum, splat, store, where
from .jit import compilable
from .lanes import B_, GOOD, HIGH, LOW, NORM, REQUIRED, S_, UNIT, Y, cable, matrix, wrench
from .lanes_proof import prove_in_lanes

__all__ = ["newton_in_lanes", "newton_size"]

_ON_THE_WAY = 4  # steps of the search along a step
_MET = 3e-14  # wrench error that is rounding, relative to the terms that it is the sum of
_DAMPING = 1e-12  # relative to the mean of H's diagonal
_SMALL_PIVOT = 1e-8  # or eigenvalue, relative to the same


@compilable()
def _rows(n, m):
    """Return the first rows of the scratch: y, step, r, B^T y, the change of it, one where a cable is free, and H."""
    return 0, n, 2 * n, 3 * n, 3 * n + m, 3 * n + 2 * m, 3 * n + 3 * m


@compilable()
def newton_size(n, m):
    """Return how many numbers of scratch `newton_in_lanes` needs."""
    return WIDTH * (3 * n + 3 * m + n * n)


@compilable()
def newton_in_lanes(soft, steps, again, n, m, W, V):
    """Take `steps` steps at the prepared problems.

    `soft` is 1/rho. The multipliers are in the first n rows of V: with `again` those to continue from, then those
    reached.
    """
    y, step, r, pull, change, free, _ = _rows(n, m)
    size = splat(0.0)
    for i in range(n * m):
        x = load(W, matrix(B_, n, m) + i)
        size = size + x * x
    size = size / n
    damping = _DAMPING * size + soft
    going = load(W, GOOD) > 0.0
    found = going & ~going
    smallest = splat(0.0)
    if not again:
        for c in range(m):
            store(V, free + c, splat(1.0))
        for i in range(n):
            store(V, r + i, load(W, wrench(Y, n, m) + i))
        smallest = _factor(n, m, W, V, damping)
        # Without full rank "infeasible" may be wrong: such matrices are left to `single`, and nan marks them next time.
        judged = (_least_eigenvalue(n, m, V) > _SMALL_PIVOT * size) | (splat(soft) > 0.0)
        _solve(n, m, V)
        for i in range(n):
            store(V, y + i, where(judged, load(V, step + i), splat(np.nan)))
    going = going & (load(V, y) <= np.inf)
    for turn in range(steps):
        met = going & _evaluate(soft, found, n, m, W, V)
        if soft == 0.0:
            met = met & (smallest > _SMALL_PIVOT * size)
        found, going = found | met, going & ~met
        if soft == 0.0 and any_of(going):
            going = going & ~_prove(going, n, m, W, V, y, pull)
            if turn == 0 and any_of(going):
                _pulls(n, m, W, V, r, change)
                going = going & ~_prove(going, n, m, W, V, r, change)
        if not any_of(going):
            break
        smallest = _factor(n, m, W, V, damping)
        _solve(n, m, V)
        _pulls(n, m, W, V, step, change)
        if soft == 0.0:
            going = going & ~_prove(going, n, m, W, V, step, change)
        length = where(going, _length(soft, n, m, W, V), splat(0.0))
        for i in range(n):
            x = load(V, y + i)
            store(V, y + i, where(going, x + length * load(V, step + i), x))
    if soft > 0.0 and any_of(found):  # r = y / rho is what is missing of the wrench: more than there is, or a trade
        _pulls(n, m, W, V, y, pull)
        _prove(found, n, m, W, V, y, pull)
    store(W, GOOD, where(found, splat(1.0), splat(0.0)))


@compilable()
def _pulls(n, m, W, V, d, into):
    """Put B^T d into rows."""
    for c in range(m):
        total = splat(0.0)
        for i in range(n):
            total = total + load(W, matrix(B_, n, m) + i * m + c) * load(V, d + i)
        store(V, into + c, total)


@compilable()
def _evaluate(soft, found, n, m, W, V):
    """Find s, r and the free cables for y; s stays as it is where `found`. Return where r is rounding."""
    y, _, r, pull, _, free, _ = _rows(n, m)
    _pulls(n, m, W, V, y, pull)
    terms, error = load(W, REQUIRED), splat(0.0)
    for c in range(m):
        low, high, p = load(W, cable(LOW, m) + c), load(W, cable(HIGH, m) + c), load(V, pull + c)
        s = minimum(maximum(p, low), high)
        store(V, free + c, where((p > low) & (p < high), splat(1.0), splat(0.0)))
        s = where(found, load(W, cable(S_, m) + c), s)
        store(W, cable(S_, m) + c, s)
        terms = terms + load(W, cable(NORM, m) + c) * load(W, cable(UNIT, m) + c) * magnitude(s)
    for i in range(n):
        x = soft * load(V, y + i)
        total = load(W, wrench(Y, n, m) + i) - x
        for c in range(m):
            total = total - load(W, matrix(B_, n, m) + i * m + c) * load(W, cable(S_, m) + c)
        store(V, r + i, total)
        terms = terms + magnitude(x)
        error = maximum(magnitude(total), error)
    return error <= _MET * terms


@compilable()
def _prove(going, n, m, W, V, d, pulls):
    """Return where d, with B^T d in `pulls`, proves that the wrench is out of reach."""
    gap = splat(0.0)
    for i in range(n):
        gap = gap + load(V, d + i) * load(W, wrench(Y, n, m) + i)
    demand = gap
    for c in range(m):
        p = load(V, pulls + c)
        gap = gap - p * where(p > 0.0, load(W, cable(HIGH, m) + c), load(W, cable(LOW, m) + c))
    promising = going & (gap > 1e-9 * demand)
    return prove_in_lanes(promising, n, m, W, V, d) if any_of(promising) else promising


@compilable()
def _factor(n, m, W, V, damping):
    """Make H of the free cables, factor it as L D L^T and return its least pivot.

    Then H has L D on and below the diagonal, but 1/D on it, and L^T above.
    """
    _make_H(n, m, W, V)
    H = _rows(n, m)[-1]
    smallest = splat(np.inf)
    for j in range(n):
        pivot = load(V, H + j * n + j) + damping
        for e in range(j):
            pivot = pivot - load(V, H + j * n + e) * load(V, H + e * n + j)
        smallest = minimum(pivot, smallest)
        inverse = 1.0 / maximum(pivot, 0.5 * damping)
        store(V, H + j * n + j, inverse)
        for i in range(j + 1, n):
            x = load(V, H + i * n + j)
            for e in range(j):
                x = x - load(V, H + i * n + e) * load(V, H + e * n + j)
            store(V, H + i * n + j, x)
            store(V, H + j * n + i, x * inverse)
    return smallest


@compilable()
def _make_H(n, m, W, V):
    """Make B_F B_F^T, the lower triangle, in blocks of two by three that do not wait for each other."""
    free, H = _rows(n, m)[-2:]
    B = matrix(B_, n, m)
    for i in range(0, n, 2):
        row, next_row = i, min(i + 1, n - 1)
        for j in range(0, next_row + 1, 3):
            first, second, third = j, min(j + 1, n - 1), min(j + 2, n - 1)
            a0, a1, a2, b0, b1, b2 = splat(0.0), splat(0.0), splat(0.0), splat(0.0), splat(0.0), splat(0.0)
            for c in range(m):
                used = load(V, free + c)
                x, y = used * load(W, B + row * m + c), used * load(W, B + next_row * m + c)
                z = load(W, B + first * m + c)
                a0, b0 = a0 + x * z, b0 + y * z
                z = load(W, B + second * m + c)
                a1, b1 = a1 + x * z, b1 + y * z
                z = load(W, B + third * m + c)
                a2, b2 = a2 + x * z, b2 + y * z
            store(V, H + row * n + first, a0)
            store(V, H + row * n + second, a1)
            store(V, H + row * n + third, a2)
            store(V, H + next_row * n + first, b0)
            store(V, H + next_row * n + second, b1)
            store(V, H + next_row * n + third, b2)


@compilable()
def _least_eigenvalue(n, m, V):
    """Bound the least eigenvalue of H, factored, from below: by one over the trace of its inverse. Overwrites step.

    The least pivot is no bound. Rows are not in the order of their size, and damping makes pivots of what depends on a
    short row before it.
    """
    _, step, _, _, _, _, H = _rows(n, m)
    trace = splat(0.0)
    for j in range(n):
        store(V, step + j, splat(1.0))
        trace = trace + load(V, H + j * n + j)
        for i in range(j + 1, n):
            x = splat(0.0)
            for e in range(j, i):
                x = x - load(V, H + e * n + i) * load(V, step + e)
            store(V, step + i, x)
            trace = trace + x * x * load(V, H + i * n + i)
    return 1.0 / trace


@compilable()
def _solve(n, m, V):
    """Put H^-1 r into step."""
    _, step, r, _, _, _, H = _rows(n, m)
    for i in range(n):
        total = load(V, r + i)
        for e in range(i):
            total = total - load(V, H + e * n + i) * load(V, step + e)
        store(V, step + i, total)
    for i in range(n - 1, -1, -1):
        total = load(V, step + i) * load(V, H + i * n + i)
        for e in range(i + 1, n):
            total = total - load(V, H + i * n + e) * load(V, step + e)
        store(V, step + i, total)


@compilable()
def _length(soft, n, m, W, V):
    """Return how far to go along the step: all of it, or to where the dual function is largest."""
    y, step, _, pull, change, _, _ = _rows(n, m)
    first, curve = splat(0.0), splat(0.0)
    for i in range(n):
        x = load(V, step + i)
        first = first + (load(W, wrench(Y, n, m) + i) - soft * load(V, y + i)) * x
        curve = curve + soft * x * x
    start = first
    for c in range(m):
        s = minimum(maximum(load(V, pull + c), load(W, cable(LOW, m) + c)), load(W, cable(HIGH, m) + c))
        start = start - load(V, change + c) * s
    length, left, right = splat(1.0), splat(0.0), splat(np.inf)
    for _ in range(_ON_THE_WAY):
        slope, bend = first - length * curve, curve
        for c in range(m):
            q, low, high = load(V, change + c), load(W, cable(LOW, m) + c), load(W, cable(HIGH, m) + c)
            x = load(V, pull + c) + length * q
            slope = slope - q * minimum(maximum(x, low), high)
            bend = bend + where((x > low) & (x < high), q * q, splat(0.0))
        too_far = slope < -1e-12 * start
        searching = too_far | (right < np.inf)
        if not any_of(searching):
            break
        right = where(too_far, length, right)
        left = where(too_far, left, length)
        better = length + slope / bend
        inside = (better > left) & (better < right)
        length = where(searching, where(inside, better, 0.5 * (left + right)), length)
    return length
