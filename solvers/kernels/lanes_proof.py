"""Many directions at once: which of them prove their wrench out of reach. As `proof.proves`, but for rank."""

from __future__ import annotations

from ...base.machine_code.simd import load, magnitude, maximum, minimum, splat, sqrt, store, where
from ...base.tolerances import FEASIBILITY, NEGLIGIBLE, ORTHOGONAL, ROUNDING
from .codes import CLEAR, REACH_OF_PULL, REACH_OF_TERMS
from .jit import compilable
from .lanes import (
    NORM,
    PER_LENGTH,
    PROVEN,
    REF,
    REQUIRED,
    SA,
    SHORTFALL,
    SUPPORT,
    SW,
    T_HIGH,
    T_LOW,
    D,
    cable,
    matrix,
    wrench,
)

__all__ = ["prove_in_lanes"]


@compilable()
def prove_in_lanes(chosen, n, m, W, V, d):
    """Keep the directions in rows d of V, in the units of S w, where `chosen` and proven; return where.

    What is kept are the unit direction for w itself, its support and the shortfall; PROVEN marks where.
    """
    square = splat(0.0)
    for i in range(n):
        x = load(V, d + i)
        square = square + x * x
    usable = chosen & (square > 0.0) & (square < 1e200)
    unit = 1.0 / sqrt(where(usable, square, splat(1.0)))
    demand, rounded = splat(0.0), splat(0.0)
    for i in range(n):
        demand = demand + unit * load(V, d + i) * load(W, wrench(SW, n, m) + i)
    support, pulls = splat(0.0), splat(0.0)
    for c in range(m):
        low, high, norm = load(W, cable(T_LOW, m) + c), load(W, cable(T_HIGH, m) + c), load(W, cable(NORM, m) + c)
        nearest = magnitude(minimum(maximum(low, splat(0.0)), high))
        rounded = rounded + norm * (magnitude(load(W, cable(REF, m) + c)) + nearest)
        pull, terms = splat(0.0), splat(0.0)
        for i in range(n):
            x = unit * load(V, d + i) * load(W, matrix(SA, n, m) + i * m + c)
            pull, terms = pull + x, terms + magnitude(x)
        limit = where(pull > 0.0, high, low)
        pulls = where(magnitude(pull) > NEGLIGIBLE * norm, splat(1.0), pulls)
        # Known amounts count at any size; of a cable without a limit that pulls nothing is known.
        known = magnitude(limit) <= 1e50
        limit = where(known, limit, splat(0.0))
        usable = usable & (known | (magnitude(pull) <= ORTHOGONAL * norm))
        reach = pull * limit
        support = support + reach
        rounded = rounded + REACH_OF_PULL * magnitude(reach) + REACH_OF_TERMS * terms * magnitude(limit)
    doubt = CLEAR * (FEASIBILITY * load(W, REQUIRED) + ROUNDING * rounded)
    proven = usable & (pulls > 0.0) & (demand - support > doubt)
    store(W, PROVEN, where(proven, splat(1.0), load(W, PROVEN)))
    store(W, SUPPORT, where(proven, support, load(W, SUPPORT)))
    store(W, SHORTFALL, where(proven, demand - support, load(W, SHORTFALL)))
    for i in range(n):
        x = unit * load(V, d + i)
        if n == 6 and i >= 3:
            x = x * load(W, PER_LENGTH)
        store(W, wrench(D, n, m) + i, where(proven, x, load(W, wrench(D, n, m) + i)))
    return proven
