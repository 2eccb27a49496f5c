"""Kernel: the iterate that a solve begins with, and what of the problem does not change during it."""

import math

from .layout import (
    CHANGES,
    COSTATE,
    CURVATURE,
    D_POINT,
    DYNAMICS,
    FIXED,
    FLOOR,
    HESSIAN,
    HIGH,
    HIGHEST,
    LEFT,
    LIMIT,
    LOW,
    LOWEST,
    MASK,
    MP,
    MULTIPLIER,
    NP,
    OFF_ROW,
    OFFSET,
    PAIRS,
    POINT,
    PP,
    PRODUCT,
    RANGE,
    ROWS,
    SCALE,
    SCALE_CONTROL,
    SCALE_FORCE,
    SCALE_ROW,
    SHIFT,
    SLACK,
    SQUARE,
    STAGES,
    START,
    STEEP,
    V_WORK,
    VALUE,
    WEIGHT,
    WP,
    M,
    N,
    P,
    W,
)
from .products import add_rows
from .vectors import fused, largest8, load8, splat8, store8

DAMP, MU0, NEARLY_NOTHING = 1.0, 10.0, 1e-200


def set_limits(work, at):
    """Write which limits there are; return their number, nan if bounds cross or are no numbers."""
    stages, n, m, p, w, wp = at[STAGES], at[N], at[M], at[P], at[W], at[WP]
    bounds, pairs = stages * at[MP], 0.0
    for i in range(m):
        work[at[RANGE] + i] = 0.0
    for k in range(stages):
        for i in range(m):
            place = k * at[MP] + i
            lowest, highest = work[at[LOWEST] + place], work[at[HIGHEST] + place]
            below, above = lowest > -math.inf, highest < math.inf
            width = highest - lowest
            if not width >= 0.0:
                pairs = math.nan
            work[at[CHANGES] + place] = 1.0
            if below and above and not width > FIXED * max(abs(lowest), abs(highest)):
                work[at[CHANGES] + place] = 0.0
                work[at[LOW] + place] = work[at[HIGH] + place] = lowest
                below = above = False
            else:
                work[at[LOW] + place] = lowest if below else -math.inf
                work[at[HIGH] + place] = highest if above else math.inf
            work[at[MASK] + place] = 1.0 if below else 0.0
            work[at[MASK] + bounds + place] = 1.0 if above else 0.0
            pairs += (1.0 if below else 0.0) + (1.0 if above else 0.0)
            work[at[RANGE] + i] = max(work[at[RANGE] + i], width)
        for i in range(m, at[MP]):
            work[at[CHANGES] + k * at[MP] + i] = 1.0
        # The lower left of each matrix, from the upper right.
        hessian = at[HESSIAN] + k * w * wp
        for i in range(m):
            for j in range(m, w):
                work[hessian + j * wp + i] = work[hessian + i * wp + j]
    for i in range(0, at[MP], 8):
        most = splat8(0.0)
        for k in range(stages):
            hessian, dynamics = at[HESSIAN] + k * w * wp, at[DYNAMICS] + k * n * wp + i
            sums = splat8(0.0)
            for j in range(n):
                b = load8(work, dynamics + j * wp)
                sums = fused(work[hessian + (w + m + j) * wp + m + j], b * b, sums)
            for j in range(i, min(m, i + 8)):
                work[at[V_WORK] + j - i] = work[hessian + j * wp + j]
            most = largest8(sums + load8(work, at[V_WORK]), most)
        store8(work, at[CURVATURE] + i, most)
    return pairs + 2.0 * p * stages


def begin_point(work, at, warm):
    """Write the given state, and for a cold start zeros and controls amid their bounds."""
    if not warm:
        for i in range(2 * (at[STAGES] + 1) * at[WP]):
            work[at[POINT] + i] = 0.0
        for i in range(2 * at[PAIRS]):
            work[at[SLACK] + i] = 1.0
    # What vectors reach beyond sizes must be numbers, whatever the last problem left there.
    for i in range(2 * (at[STAGES] + 1) * at[WP] + 2 * at[PAIRS]):
        work[at[D_POINT] + i] = 0.0
    for i in range(at[N]):
        work[at[POINT] + at[M] + i] = work[at[START] + i]
    push_inside(work, at, 0.0 if warm else 0.5)


def shift(work, at):
    """Move a solution by one stage to the front, and repeat its last stage behind it."""
    stages, wp = at[STAGES], at[WP]
    # Each block is one row for each stage; the multipliers of rows follow those of both bounds.
    for block, step in ((at[POINT], wp), (at[COSTATE] + wp, wp)):
        for i in range((stages - 1) * step):
            work[block + i] = work[block + step + i]
    for side in range(2):
        block = at[MULTIPLIER] + side * stages * at[MP]
        for i in range((stages - 1) * at[MP]):
            work[block + i] = work[block + at[MP] + i]
    block = at[MULTIPLIER] + 2 * stages * at[MP]
    for i in range((stages - 1) * at[PP]):
        work[block + i] = work[block + at[PP] + i]
    last = at[POINT] + (stages - 1) * wp
    for i in range(at[N]):
        work[last + at[M] + i] = work[last + wp + at[M] + i]
        work[last + wp + at[M] + i] = work[at[OFFSET] + (stages - 1) * at[NP] + i]
    add_rows(work, last + wp + at[M], at[DYNAMICS] + (stages - 1) * at[N] * wp, wp, last, at[N], at[W])


def push_inside(work, at, margin):
    """Put controls between their bounds, at least this part of the range inside."""
    for k in range(at[STAGES]):
        for i in range(at[M]):
            place, point = k * at[MP] + i, at[POINT] + k * at[WP] + i
            low, high = work[at[LOW] + place], work[at[HIGH] + place]
            u, distance = work[point], margin * (high - low)
            if distance == math.inf:
                distance = margin * max(abs(u), 1.0)
            work[point] = max(min(u, high - distance), low + distance)


def begin_damped(work, at):
    """Write slacks and multipliers of a first step that is damped, and has no limits."""
    bounds = at[STAGES] * at[MP]
    for k in range(at[STAGES]):
        for i in range(at[M]):
            place = k * at[MP] + i
            work[at[SLACK] + place] = work[at[SLACK] + bounds + place] = 1.0
            work[at[MULTIPLIER] + place] = work[at[MULTIPLIER] + bounds + place] = DAMP * work[at[CURVATURE] + i]
    for i in range(at[STAGES] * at[PP]):
        row = 2 * bounds + i
        work[at[STEEP] + i] = work[at[SHIFT] + i] = work[at[OFF_ROW] + i] = 0.0
        work[at[SLACK] + row] = work[at[SLACK] + row + at[STAGES] * at[PP]] = 1.0
        work[at[MULTIPLIER] + row], work[at[MULTIPLIER] + row + at[STAGES] * at[PP]] = NEARLY_NOTHING, 1.0
    for i in range(at[PAIRS]):
        work[at[PRODUCT] + i] = 0.0


def begin_pairs(work, at):
    """Write slacks and multipliers near the central path, for the gradient LEFT without multipliers of bounds."""
    stages, m, p, mp, pp, wp = at[STAGES], at[M], at[P], at[MP], at[PP], at[WP]
    bounds, total, pairs = stages * mp, 0.0, 0.0
    for k in range(stages):
        for i in range(m):
            place = k * mp + i
            u, force = work[at[POINT] + k * wp + i], work[at[LEFT] + k * wp + i]
            if work[at[MASK] + place] > 0.0:
                total, pairs = total + max(force, 0.0) * (u - work[at[LOW] + place]), pairs + 1.0
            if work[at[MASK] + bounds + place] > 0.0:
                total, pairs = total + max(-force, 0.0) * (work[at[HIGH] + place] - u), pairs + 1.0
    for k in range(stages):
        for i in range(p):
            place = k * pp + i
            v = work[at[VALUE] + place]
            total, pairs = total + work[at[WEIGHT] + place] * abs(v) * 0.1, pairs + 1.0
    centre = MU0 * total / max(pairs, 1.0) + 1e-12
    for k in range(stages):
        for i in range(m):
            place = k * mp + i
            u, force = work[at[POINT] + k * wp + i], work[at[LEFT] + k * wp + i]
            slack = u - work[at[LOW] + place] if work[at[MASK] + place] > 0.0 else 1.0
            work[at[SLACK] + place] = slack
            work[at[MULTIPLIER] + place] = max(force, 0.0) + centre / slack
            slack = work[at[HIGH] + place] - u if work[at[MASK] + bounds + place] > 0.0 else 1.0
            work[at[SLACK] + bounds + place] = slack
            work[at[MULTIPLIER] + bounds + place] = max(-force, 0.0) + centre / slack
        for i in range(p):
            row = k * pp + i
            begin_row(work, at, row, centre)


def begin_row(work, at, row, centre):
    """Write slack, excess and multipliers of a soft row on the central path, or near it with a quadratic penalty."""
    size = at[STAGES] * at[PP]
    first = 2 * at[STAGES] * at[MP]
    v, weight, square = work[at[VALUE] + row], work[at[WEIGHT] + row], work[at[SQUARE] + row]
    steep = weight + square * max(v, 0.0) + math.sqrt(square * centre)
    along = v * steep
    hypotenuse = math.sqrt(along * along + 4.0 * centre * centre)
    excess = (hypotenuse + along + 2.0 * centre) / (2.0 * steep)
    excess = max(excess, 4.0 * centre / (weight + math.sqrt(weight * weight + 8.0 * square * centre)))
    work[at[SLACK] + first + row] = excess - v
    work[at[SLACK] + first + size + row] = excess
    work[at[MULTIPLIER] + first + row] = weight + square * excess - centre / excess
    work[at[MULTIPLIER] + first + size + row] = centre / excess
    work[at[OFF_ROW] + row] = 0.0


def begin_warm(work, at, part):
    """Push controls, slacks and multipliers of a nearby solution inside, by this part of their scales."""
    stages, m, p, mp, pp, wp = at[STAGES], at[M], at[P], at[MP], at[PP], at[WP]
    bounds = stages * mp
    for k in range(stages):
        for i in range(m):
            lower, point = k * mp + i, at[POINT] + k * wp + i
            upper = lower + bounds
            low, high, u = work[at[LOW] + lower], work[at[HIGH] + lower], work[point]
            distance = min(part * work[at[SCALE_CONTROL] + i], 0.4 * (high - low))
            force = part * work[at[SCALE_CONTROL] + i] * (work[at[SCALE] + i] + FLOOR)
            u = max(min(u, high - distance), low + distance)
            work[point] = u
            slack = u - low if work[at[MASK] + lower] > 0.0 else 1.0
            work[at[SLACK] + lower] = slack
            work[at[MULTIPLIER] + lower] = max(work[at[MULTIPLIER] + lower], force / slack)
            slack = high - u if work[at[MASK] + upper] > 0.0 else 1.0
            work[at[SLACK] + upper] = slack
            work[at[MULTIPLIER] + upper] = max(work[at[MULTIPLIER] + upper], force / slack)
        for i in range(p):
            work[at[V_WORK] + i] = -work[at[LIMIT] + k * pp + i]
        add_rows(work, at[V_WORK], at[ROWS] + k * p * wp, wp, at[POINT] + k * wp, p, at[W])
        for i in range(p):
            place = k * pp + i
            row, other = 2 * bounds + place, 2 * bounds + stages * pp + place
            v, weight, square = work[at[V_WORK] + i], work[at[WEIGHT] + place], work[at[SQUARE] + place]
            scale = work[at[SCALE_FORCE] + i] + FLOOR
            centre = part * scale * (work[at[SCALE_ROW] + i] + FLOOR)
            excess = max(v, part * (work[at[SCALE_ROW] + i] + FLOOR))
            most = weight + square * excess
            force = min(max(work[at[MULTIPLIER] + row], part * min(scale, most)), (1.0 - 0.5 * part) * most)
            work[at[MULTIPLIER] + row], work[at[MULTIPLIER] + other] = force, most - force
            slack = max(-v, centre / force)
            work[at[SLACK] + row], work[at[SLACK] + other] = slack, excess
            work[at[OFF_ROW] + place] = v - excess + slack
