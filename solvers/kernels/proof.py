"""Check whether a direction proves a wrench out of reach: nothing is called infeasible that this does not confirm."""

from __future__ import annotations

import math

import numpy as np

from ...tolerances import FEASIBILITY, NEGLIGIBLE, ROUNDING
from .codes import CLEAR, INFEASIBLE, SINGULAR, UNSURE
from .jit import compilable

__all__ = ["proves"]


@compilable()
def proves(A, w, lower, upper, n, m, per_length, required, rounding, largest, d, info):
    """Check whether the scaled direction d (n,), made unit and unscaled here, proves w out of reach.

    `required`, `rounding` and `largest` are those of `single.what_counts`. Return INFEASIBLE, SINGULAR if no cable
    pulls along it, or UNSURE; info gets support and shortfall.
    """
    total = 0.0
    for i in range(n):
        total += d[i] * d[i]
    if not 0.0 < total < np.inf:
        return UNSURE
    total = 1.0 / math.sqrt(total)
    demand, support, status = 0.0, 0.0, SINGULAR
    for i in range(n):
        d[i] *= total * (per_length if n == 6 and i >= 3 else 1.0)
        demand += d[i] * w[i]
    for c in range(m):
        pull = 0.0
        for i in range(n):
            pull += d[i] * A[i * m + c]
        if abs(pull) > NEGLIGIBLE * largest:
            status = INFEASIBLE
            reach = pull * (upper[c] if pull > 0.0 else lower[c])
            support += reach
            rounding += 1e2 * abs(reach)
    info[0], info[1] = support, demand - support
    # `not` for the nan of infinite limits
    if not demand - support > CLEAR * (FEASIBILITY * required + ROUNDING * rounding):
        return UNSURE
    return status
