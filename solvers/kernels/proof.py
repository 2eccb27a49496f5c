"""Check whether a direction proves a wrench out of reach: nothing is called infeasible that this does not confirm."""

from __future__ import annotations

import math

import numpy as np

from ...tolerances import FEASIBILITY, NEGLIGIBLE, RANK, ROUNDING
from .codes import CLEAR, INFEASIBLE, SINGULAR, UNSURE
from .jit import compilable
from .memory import integers

__all__ = ["outside_range", "proves"]


@compilable()
def proves(A, w, lower, upper, ref, n, m, per_length, d, info):
    """Check whether the scaled direction d (n,), made unit and unscaled here, proves w out of reach.

    Return INFEASIBLE, SINGULAR if no cable pulls along it, or UNSURE; info gets support and shortfall.
    """
    total = 0.0
    for i in range(n):
        total += d[i] * d[i]
    if not 0.0 < total < np.inf:
        return UNSURE
    total = 1.0 / math.sqrt(total)
    demand, required = 0.0, 0.0
    for i in range(n):
        scale = per_length if n == 6 and i >= 3 else 1.0
        d[i] *= total * scale
        demand += d[i] * w[i]
        required += (scale * w[i]) * (scale * w[i])
    required = math.sqrt(required)
    rounding, largest = 0.0, 0.0
    for c in range(m):
        square = 0.0
        for i in range(n):
            x = A[i * m + c] * (per_length if n == 6 and i >= 3 else 1.0)
            square += x * x
        largest = max(largest, square)
        norm = math.sqrt(square)
        nearest = abs(min(max(lower[c], 0.0), upper[c]))
        required += norm * nearest
        rounding += norm * (abs(ref[c]) + nearest)
    small = NEGLIGIBLE * math.sqrt(largest)
    support = 0.0
    status = SINGULAR
    for c in range(m):
        pull = 0.0
        for i in range(n):
            pull += d[i] * A[i * m + c]
        if abs(pull) > small:
            status = INFEASIBLE
            reach = pull * (upper[c] if pull > 0.0 else lower[c])
            support += reach
            rounding += 1e2 * abs(reach)
    info[0], info[1] = support, demand - support
    # `not` for the nan of infinite limits
    if not demand - support > CLEAR * (FEASIBILITY * required + ROUNDING * rounding):
        return UNSURE
    return status


@compilable()
def outside_range(A, w, n, m, per_length, d, work):
    """Put the part of S w outside the range of S A into d (n,); False if it is rounding. By Gram-Schmidt, twice."""
    Q, x = work[: n * n], work[n * n : n * n + n]
    used = integers(m)
    largest, rank = 0.0, 0
    for _ in range(min(n, m)):
        best, most = -1, 0.0
        for c in range(m):
            if used[c] == 1:
                continue
            for i in range(n):
                x[i] = A[i * m + c] * (per_length if n == 6 and i >= 3 else 1.0)
            square = _without(Q, rank, n, x)
            if square > most:
                best, most = c, square
        largest = max(largest, most)
        if best < 0 or most <= RANK * RANK * largest:
            break
        for i in range(n):
            x[i] = A[i * m + best] * (per_length if n == 6 and i >= 3 else 1.0)
        most = math.sqrt(_without(Q, rank, n, x))
        for i in range(n):
            Q[rank * n + i] = x[i] / most
        used[best] = 1
        rank += 1
    before = 0.0
    for i in range(n):
        d[i] = w[i] * (per_length if n == 6 and i >= 3 else 1.0)
        before += d[i] * d[i]
    if rank == n:
        return False
    return _without(Q, rank, n, d) > 1e-20 * before


@compilable()
def _without(Q, rank, n, x):
    """Remove from x (n,) its parts along the rows of Q, in place, and return the square of what is left."""
    for _ in range(2):
        for j in range(rank):
            dot = 0.0
            for i in range(n):
                dot += Q[j * n + i] * x[i]
            for i in range(n):
                x[i] -= dot * Q[j * n + i]
    square = 0.0
    for i in range(n):
        square += x[i] * x[i]
    return square
