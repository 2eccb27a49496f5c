"""Kernel: what is left of the conditions of optimality at an iterate, each relative to the largest of its terms.

A state, a control or a row has one unit at all stages, so that a residual is the largest over the stages of an error,
divided by the largest over the stages of the terms that it is the sum of. No unit changes it.
"""

import math

from .layout import (
    CHANGES,
    COMPLEMENTARITY,
    COSTATE,
    CURVATURE,
    DYNAMIC,
    DYNAMICS,
    FLOOR,
    FREE,
    GAP,
    GRADIENT,
    HESSIAN,
    HIGH,
    LEFT,
    LIMIT,
    LOW,
    MASK,
    MODIFIED,
    MP,
    MULTIPLIER,
    NP,
    OFFSET,
    POINT,
    PP,
    RANGE,
    ROWS,
    SCALE,
    SCALE_CONTROL,
    SCALE_FORCE,
    SCALE_GAP,
    SCALE_ROW,
    SOFT,
    SQUARE,
    STAGES,
    STATIONARITY,
    V_WORK,
    VALUE,
    WEIGHT,
    WORST,
    WORST_GAP,
    WORST_PAIR,
    WORST_ROW,
    WP,
    M,
    N,
    P,
    W,
)
from .products import add_columns, add_rows
from .vectors import fused, largest8, load8, magnitude8, splat8, store8, total8, where8


def measure(work, at, settings):
    """Write errors of all conditions and their residuals; return the largest residual, inf where one is no number."""
    zero = splat8(0.0)
    for block, size in ((WORST, at[WP]), (SCALE, at[WP]), (WORST_PAIR, at[MP]), (SCALE_CONTROL, at[MP])):
        for i in range(0, size, 8):
            store8(work, at[block] + i, zero)
    for block, size in ((WORST_GAP, at[NP]), (SCALE_GAP, at[NP]), (WORST_ROW, at[PP])):
        for i in range(0, size, 8):
            store8(work, at[block] + i, zero)
    for block in (SCALE_ROW, SCALE_FORCE):
        for i in range(0, at[PP], 8):
            store8(work, at[block] + i, zero)
    for k in range(at[STAGES] + 1):
        _measure_gradient(work, at, k)
    for k in range(at[STAGES]):
        _measure_dynamics(work, at, k)
        if at[P] > 0:
            _measure_rows(work, at, k)
    if not _is_finite(work, at):
        settings[STATIONARITY] = settings[DYNAMIC] = settings[COMPLEMENTARITY] = settings[SOFT] = math.inf
        return math.inf
    stationarity = dynamic = complementarity = soft = 0.0
    for i in range(at[W]):
        stationarity = _larger(stationarity, work[at[WORST] + i] / (work[at[SCALE] + i] + FLOOR))
    for i in range(at[N]):
        dynamic = _larger(dynamic, work[at[WORST_GAP] + i] / (work[at[SCALE_GAP] + i] + FLOOR))
    for i in range(at[M]):
        scale, curvature = work[at[SCALE] + i] + FLOOR, work[at[CURVATURE] + i]
        # The range of a control, but no more than an unlimited control would use of it.
        reach = min(work[at[RANGE] + i], scale / curvature) if curvature > 0.0 else 0.0
        work[at[SCALE_CONTROL] + i] += reach + FLOOR
        pair = work[at[WORST_PAIR] + i] / scale / work[at[SCALE_CONTROL] + i]
        complementarity = _larger(complementarity, pair)
    for i in range(at[P]):
        row = work[at[WORST_ROW] + i] / (work[at[SCALE_ROW] + i] + FLOOR) / (work[at[SCALE_FORCE] + i] + FLOOR)
        soft = _larger(soft, row)
    settings[STATIONARITY], settings[DYNAMIC] = stationarity, dynamic
    settings[COMPLEMENTARITY], settings[SOFT] = complementarity, soft
    return _larger(_larger(stationarity, dynamic), _larger(complementarity, soft))


def _is_finite(work, at):
    """Return whether all errors are numbers: comparisons ignore those that are none."""
    total = splat8(0.0)
    for i in range(0, (at[STAGES] + 1) * at[WP], 8):
        total = fused(0.0, load8(work, at[LEFT] + i), total)
    for i in range(0, (at[STAGES] + 1) * at[NP], 8):
        total = fused(0.0, load8(work, at[GAP] + i), total)
    for i in range(0, at[STAGES] * at[PP], 8):
        total = fused(0.0, load8(work, at[VALUE] + i), total)
    return total8(total) == 0.0


def _larger(x, y):
    """Return the larger, inf where y is no number."""
    if y <= x:
        return x
    return y if y > x else math.inf


def _measure_gradient(work, at, k):
    """Write what is left of the Lagrangian's gradient at a stage."""
    stages, n, m, p, w = at[STAGES], at[N], at[M], at[P], at[W]
    wp, mp, pp = at[WP], at[MP], at[PP]
    point, costate, cost, dual = at[POINT] + k * wp, at[COSTATE] + k * wp, at[V_WORK], at[V_WORK] + wp
    penalty = dual + wp
    zero = splat8(0.0)
    for i in range(0, 3 * wp, 8):
        store8(work, cost + i, zero)
    start = m if k == stages else 0
    add_columns(work, cost, at[HESSIAN] + (k * w + start) * wp, wp, point + start, w - start, w)
    if k < stages:
        add_columns(work, dual, at[DYNAMICS] + k * n * wp, wp, costate + wp + m, n, w)
        if p > 0:
            forces = at[MULTIPLIER] + 2 * stages * mp + k * pp
            add_columns(work, penalty, at[ROWS] + k * p * wp, wp, forces, p, w)
    for i in range(0, wp, 8):
        a, b, c = load8(work, cost + i), load8(work, dual + i), load8(work, penalty + i)
        g, y = load8(work, at[GRADIENT] + k * wp + i), load8(work, costate + i)
        left = a + b + c + g - y
        scale = largest8(largest8(magnitude8(a), magnitude8(b)), largest8(magnitude8(c), magnitude8(g)))
        scale = largest8(scale, magnitude8(y))
        if i < mp and k < stages:
            for side in range(2):
                place = k * mp + i + side * stages * mp
                mask, force = load8(work, at[MASK] + place), load8(work, at[MULTIPLIER] + place)
                force = mask * force
                left = left - force if side == 0 else left + force
                scale = largest8(scale, force)
        store8(work, at[MODIFIED] + k * wp + i, left)
        if i < mp and k < stages:
            left = left * load8(work, at[CHANGES] + k * mp + i)
        if k == 0:
            free = load8(work, at[FREE] + i)
            left, scale = left * free, scale * free
        store8(work, at[LEFT] + k * wp + i, left)
        store8(work, at[WORST] + i, largest8(magnitude8(left), load8(work, at[WORST] + i)))
        store8(work, at[SCALE] + i, largest8(scale, load8(work, at[SCALE] + i)))
    if k == stages:
        return
    for i in range(0, mp, 8):
        u, place = load8(work, point + i), k * mp + i
        below = (u - load8(work, at[LOW] + place)) * load8(work, at[MULTIPLIER] + place)
        pair = where8(load8(work, at[MASK] + place), magnitude8(below))
        above = load8(work, at[HIGH] + place) - u
        place += stages * mp
        above = above * load8(work, at[MULTIPLIER] + place)
        pair = largest8(pair, where8(load8(work, at[MASK] + place), magnitude8(above)))
        store8(work, at[WORST_PAIR] + i, largest8(pair, load8(work, at[WORST_PAIR] + i)))
        store8(work, at[SCALE_CONTROL] + i, largest8(magnitude8(u), load8(work, at[SCALE_CONTROL] + i)))


def _measure_dynamics(work, at, k):
    """Write the error of the dynamics that begin at a stage."""
    n, w, wp, np_ = at[N], at[W], at[WP], at[NP]
    values, following = at[V_WORK], at[POINT] + (k + 1) * wp + at[M]
    for i in range(n):
        work[values + i] = 0.0
    add_rows(work, values, at[DYNAMICS] + k * n * wp, wp, at[POINT] + k * wp, n, w)
    for i in range(n):
        moved, offset, x = work[values + i], work[at[OFFSET] + k * np_ + i], work[following + i]
        gap = moved + offset - x
        work[at[GAP] + (k + 1) * np_ + i] = gap
        work[at[WORST_GAP] + i] = max(abs(gap), work[at[WORST_GAP] + i])
        scale = max(abs(moved), max(abs(offset), abs(x)))
        work[at[SCALE_GAP] + i] = max(scale, work[at[SCALE_GAP] + i])


def _measure_rows(work, at, k):
    """Write the values of the soft rows of a stage, and how far forces are from slopes of the penalty."""
    p, w, wp, pp = at[P], at[W], at[WP], at[PP]
    values = at[VALUE] + k * pp
    for i in range(p):
        work[values + i] = 0.0
    add_rows(work, values, at[ROWS] + k * p * wp, wp, at[POINT] + k * wp, p, w)
    for i in range(p):
        place = k * pp + i
        limit, weight, square = work[at[LIMIT] + place], work[at[WEIGHT] + place], work[at[SQUARE] + place]
        force = work[at[MULTIPLIER] + 2 * at[STAGES] * at[MP] + place]
        scale = max(abs(work[values + i]), abs(limit))
        value = work[values + i] - limit
        work[values + i] = value
        excess = max(value, 0.0)
        rest = weight + square * excess - force
        # Below 0 no force is allowed, at 0 any up to the weight, above it the slope of the penalty.
        off = force * (excess - value) if value < 0.0 else abs(rest) * excess
        off = max(off, scale * max(-rest if value <= 0.0 else 0.0, -force))
        work[at[WORST_ROW] + i] = max(off, work[at[WORST_ROW] + i])
        work[at[SCALE_ROW] + i] = max(scale, work[at[SCALE_ROW] + i])
        scale = max(weight + square * excess, abs(force))
        work[at[SCALE_FORCE] + i] = max(scale, work[at[SCALE_FORCE] + i])
