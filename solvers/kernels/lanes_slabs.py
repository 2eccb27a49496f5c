"""Many problems at once with at most two more cables than equations: reduction, then one slab after another.

Each cable is a slab in the plane of the null space. The slabs are taken one after another (Seidel 1991): an optimum
that the next slab forbids moves onto its edge, cut to an interval by the slabs before. The reduction is `reduction`
without pivoting: a matrix that would need it, or one without full rank, is left to `single`. For a problem without
tensions the limits that exclude them give the direction that proves it.
"""

from __future__ import annotations

import numpy as np

from ...base.machine_code.simd import WIDTH, any_of, load, magnitude, maximum, minimum, splat, sqrt, store, where
from .codes import DECISIVE, PARALLEL, SLACK, STATIONARY
from .jit import compilable
from .lanes import (
    B_,
    DIAG,
    GOOD,
    GOOD_MATRIX,
    HIGH,
    LOW,
    N0,
    N1,
    S_,
    SIZE,
    SLACKS,
    TAU,
    Y,
    cable,
    matrix,
    wrench,
)
from .lanes_proof import prove_in_lanes

__all__ = ["reduce_lanes", "slabs_in_lanes", "slabs_size"]

_STEEP, _NEAR = 1e-6, 1e6  # sine, and distance in units of what a limit may be passed by


@compilable()
def reduce_lanes(n, m, W):
    """Reduce B to L and reflectors, and make the basis of its null space."""
    B, diag, tau = matrix(B_, n, m), wrench(DIAG, n, m), wrench(TAU, n, m)
    good = load(W, GOOD_MATRIX) > 0.0
    largest = splat(0.0)
    for j in range(n):
        gone, square = splat(0.0), splat(0.0)
        for c in range(j):
            x = load(W, B + j * m + c)
            gone = gone + x * x
        for c in range(j, m):
            x = load(W, B + j * m + c)
            square = square + x * x
        if j == 0:
            largest = square
        good = good & (square > 1e-10 * gone) & (square > 1e-10 * largest) & (square < 1e10 * largest)
        norm = sqrt(where(good, square, splat(1.0)))
        head = load(W, B + j * m + j)
        pivot = where(head > 0.0, -norm, norm)
        store(W, diag + j, pivot)
        store(W, B + j * m + j, head - pivot)
        factor = -1.0 / (pivot * (head - pivot))
        store(W, tau + j, factor)
        for i in range(j + 1, n):
            dot = splat(0.0)
            for c in range(j, m):
                dot = dot + load(W, B + j * m + c) * load(W, B + i * m + c)
            dot = dot * factor
            for c in range(j, m):
                store(W, B + i * m + c, load(W, B + i * m + c) - dot * load(W, B + j * m + c))
    store(W, GOOD_MATRIX, where(good, splat(1.0), splat(0.0)))
    for c in range(m):
        store(W, cable(N0, m) + c, splat(1.0 if c == n else 0.0))
        store(W, cable(N1, m) + c, splat(1.0 if c == n + 1 else 0.0))
    _reflect_back(n, m, W, cable(N0, m))
    _reflect_back(n, m, W, cable(N1, m))


@compilable()
def _reflect_back(n, m, W, row):
    """Apply Q_1^T to the vector in the rows from `row`."""
    B, tau = matrix(B_, n, m), wrench(TAU, n, m)
    for j in range(n - 1, -1, -1):
        dot = splat(0.0)
        for c in range(j, m):
            dot = dot + load(W, B + j * m + c) * load(W, row + c)
        dot = dot * load(W, tau + j)
        for c in range(j, m):
            store(W, row + c, load(W, row + c) - dot * load(W, B + j * m + c))


@compilable()
def slabs_size(n, m):
    """Return how many numbers of scratch `slabs_in_lanes` needs: push and d."""
    return WIDTH * (m + n)


@compilable()
def slabs_in_lanes(n, m, W, V):
    """Solve the prepared problems after `reduce_lanes`."""
    _least_norm(n, m, W)
    good = (load(W, GOOD) > 0.0) & (load(W, GOOD_MATRIX) > 0.0)
    slack = load(W, SLACKS)
    doubt = slack * _NEAR
    point = m - n == 1  # the null space is a line and the edge of a slab is a point
    excluded = good & ~good
    z0, z1 = splat(0.0), splat(0.0)
    pull, length, pull_other = splat(0.0), splat(0.0), splat(0.0)  # multipliers of the limits that z rests on
    for i in range(m):
        a, b, s = load(W, cable(N0, m) + i), load(W, cable(N1, m) + i), load(W, cable(S_, m) + i)
        low, high = load(W, cable(LOW, m) + i), load(W, cable(HIGH, m) + i)
        value = s + a * z0 + b * z1
        below, above = value < low - slack, value > high + slack
        moves = (below | above) & good
        if not any_of(moves):
            continue
        square = a * a + b * b
        cuts = square > PARALLEL * PARALLEL
        fixed = moves & ~cuts  # nothing moves this s, and it is beyond its limit
        if any_of(fixed):
            if not any_of(excluded):
                _clear(m, V)
            store(V, i, where(fixed, where(below, splat(-1.0), splat(1.0)), load(V, i)))
            good, excluded, moves = good & ~fixed, excluded | fixed, moves & cuts
        inverse = 1.0 / where(cuts, square, splat(1.0))
        root = sqrt(inverse)
        edge = (where(below, low, high) - s) * inverse
        along0, along1 = -b * root, a * root
        base0, base1 = a * edge, b * edge
        start, stop = splat(0.0 if point else -np.inf), splat(0.0 if point else np.inf)
        at_start, at_stop = splat(-1.0), splat(-1.0)
        den_start, den_stop, dot_start, dot_stop = splat(1.0), splat(1.0), splat(0.0), splat(0.0)
        for j in range(i):
            a_j, b_j = load(W, cable(N0, m) + j), load(W, cable(N1, m) + j)
            here = load(W, cable(S_, m) + j) + a_j * base0 + b_j * base1
            low_j, high_j = load(W, cable(LOW, m) + j) - here, load(W, cable(HIGH, m) + j) - here
            near = (low_j > -doubt) | (high_j < doubt)
            if point:
                # Slab j contains the point, or excludes it beyond doubt, or rounding decides.
                under, over = low_j > doubt, high_j < -doubt
                good = good & ~(moves & near & ~(under | over))
                at_start, at_stop = where(under, splat(1.0 * j), at_start), where(over, splat(1.0 * j), at_stop)
                start, stop = where(under, low_j, start), where(over, high_j, stop)
                continue
            den = a_j * along0 + b_j * along1
            parallel = magnitude(den) < PARALLEL
            # Where a slab whose limit is near is nearly parallel, rounding decides where it is met.
            good = good & ~(moves & near & (magnitude(den) < _STEEP))
            inverse = 1.0 / den
            low_j, high_j = low_j * inverse, high_j * inverse
            turned = den < 0.0
            first_j = where(parallel, splat(-np.inf), where(turned, high_j, low_j))
            last_j = where(parallel, splat(np.inf), where(turned, low_j, high_j))
            later, earlier = first_j > start, last_j < stop
            at_start, at_stop = where(later, splat(1.0 * j), at_start), where(earlier, splat(1.0 * j), at_stop)
            den_start, den_stop = where(later, den, den_start), where(earlier, den, den_stop)
            start, stop = where(later, first_j, start), where(earlier, last_j, stop)
            dot = a_j * a + b_j * b
            dot_start, dot_stop = where(later, dot, dot_start), where(earlier, dot, dot_stop)
        empty = moves & good & (start - stop > slack)
        if any_of(empty):
            # The limit that stops from below and the one from above, such that their pulls along the edge cancel.
            f = where(den_start > 0.0, -magnitude(den_stop), magnitude(den_stop))
            g = where(den_stop > 0.0, magnitude(den_start), -magnitude(den_start))
            if not any_of(excluded):
                _clear(m, V)
            _push(n, m, W, V, i, empty, at_start, at_stop, f, g)
            good, excluded = good & ~empty, excluded | empty
        shift = minimum(maximum(start, splat(0.0)), stop)
        shift = where(start > stop, 0.5 * (start + stop), shift)
        z0 = where(moves, base0 + shift * along0, z0)
        z1 = where(moves, base1 + shift * along1, z1)
        # z is the sum of the two normals, each times its multiplier.
        other = where(shift > 0.0, shift / den_start, where(shift < 0.0, shift / den_stop, splat(0.0)))
        dot = where(shift > 0.0, dot_start, dot_stop)
        own = ((a * z0 + b * z1) - other * dot) / where(cuts, square, splat(1.0))
        pull = where(moves, where(below, own, -own), pull)
        length = where(moves, square, length)
        pull_other = where(moves, magnitude(other), pull_other)
    total = splat(0.0)
    for c in range(m):
        s = load(W, cable(S_, m) + c) + load(W, cable(N0, m) + c) * z0 + load(W, cable(N1, m) + c) * z1
        store(W, cable(S_, m) + c, s)
        total = total + s * s
    good = good & (pull * sqrt(length) >= -STATIONARY * sqrt(total))
    good = good & (maximum(pull, pull_other) * slack <= DECISIVE * total)
    store(W, GOOD, where(good, splat(1.0), splat(0.0)))
    if any_of(excluded):
        _direction(n, m, W, V)
        prove_in_lanes(excluded, n, m, W, V, m)


@compilable()
def _least_norm(n, m, W):
    """Put the s of least norm that gives the wrench into S_, and its size into SLACKS."""
    B, y, own = matrix(B_, n, m), wrench(Y, n, m), cable(S_, m)
    square = splat(0.0)
    for j in range(n):
        x = load(W, y + j)
        for i in range(j):
            x = x - load(W, B + j * m + i) * load(W, own + i)
        x = x / load(W, wrench(DIAG, n, m) + j)
        square = square + x * x
        store(W, own + j, x)
    for c in range(n, m):
        store(W, own + c, splat(0.0))
    _reflect_back(n, m, W, own)
    store(W, SLACKS, SLACK * maximum(load(W, SIZE), sqrt(square)))


@compilable()
def _clear(m, V):
    """Set the multipliers, the first m rows of V, to zero."""
    for c in range(m):
        store(V, c, splat(0.0))


@compilable()
def _push(n, m, W, V, i, empty, at_start, at_stop, f, g):
    """Put the multipliers of three limits that exclude each other into the rows of V, where `empty`."""
    a, b = load(W, cable(N0, m) + i), load(W, cable(N1, m) + i)
    toward, none = splat(0.0), splat(0.0)
    for j in range(i):
        pull = where((at_start >= 1.0 * j) & (at_start <= 1.0 * j), f, none)
        pull = pull + where((at_stop >= 1.0 * j) & (at_stop <= 1.0 * j), g, none)
        pull = where(empty, pull, none)
        store(V, j, load(V, j) + pull)
        toward = toward + pull * (load(W, cable(N0, m) + j) * a + load(W, cable(N1, m) + j) * b)
    toward = toward / where(empty, a * a + b * b, splat(1.0))
    store(V, i, load(V, i) - toward)


@compilable()
def _direction(n, m, W, V):
    """Solve B^T d = push; push is in the row space of B."""
    B, diag, tau = matrix(B_, n, m), wrench(DIAG, n, m), wrench(TAU, n, m)
    for j in range(n):
        dot = splat(0.0)
        for c in range(j, m):
            dot = dot + load(W, B + j * m + c) * load(V, c)
        dot = dot * load(W, tau + j)
        for c in range(j, m):
            store(V, c, load(V, c) - dot * load(W, B + j * m + c))
    for j in range(n - 1, -1, -1):
        x = load(V, j)
        for r in range(j + 1, n):
            x = x - load(W, B + r * m + j) * load(V, m + r)
        store(V, m + j, x / load(W, diag + j))
