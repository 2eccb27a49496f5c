"""Kernel: Mehrotra's predictor and corrector for the QP of all stages; see `docs/horizon.md`."""

import math

from .begin import begin_damped, begin_pairs, begin_point, begin_warm, push_inside, set_limits, shift
from .layout import (
    BEST,
    CHANGES,
    COLD,
    CONVERGED,
    COUNT,
    D_MULTIPLIER,
    D_POINT,
    D_SLACK,
    DYNAMICS,
    FACTOR,
    HIGHEST,
    HUGE,
    INVERSE,
    ITERATIONS,
    LEFT,
    LOWEST,
    MASK,
    MODIFIED,
    MP,
    MULTIPLIER,
    NP,
    OFF_ROW,
    OFFSET,
    PAIRS,
    POINT,
    PP,
    PRODUCT,
    REACHED,
    ROWS,
    SHIFT,
    SHIFTED,
    SLACK,
    SQUARE,
    STAGES,
    STEEP,
    TOLERANCE,
    V_WORK,
    WARM,
    WP,
    M,
    N,
    P,
    W,
)
from .measure import measure
from .products import add_columns, add_rows
from .riccati import factorise, solve_upper, substitute
from .vectors import fused, largest8, load8, splat8, store8, total8

# A warm start is pushed inside by the part of the scales by which its residuals are off, within these limits.
LEAST_PUSH, MOST_PUSH = 1e-3, 0.1
APART = 1e-3  # smallest product of slack and multiplier, in units of their mean
PATIENCE = 20  # iterations after which a warm start is given up
# Iterations without progress, or in all, after which the correction of second order may lead in circles: then steps go
# without it, to products of this part of their mean.
CYCLE, LATE, CENTRAL = 7, 32, 0.3
# Iterations without progress, and residual in tolerances, at which rounding permits no more.
STUCK, NEAR = 4, 1e3
SHORT = 0.2  # a step that is shorter is replaced


def solve_stages(work, at, settings):
    """Solve the problem in the array, write the best iterate there, and residuals to `settings`."""
    pairs = set_limits(work, at)
    warm = settings[WARM] != COLD
    if settings[WARM] == SHIFTED:
        shift(work, at)
    begin_point(work, at, warm)
    error = measure(work, at, settings) if warm else math.inf
    if error < math.inf:
        begin_warm(work, at, min(max(error, LEAST_PUSH), MOST_PUSH))
    else:
        begin_point(work, at, False)
        _begin_cold(work, at, settings)
    best, count, most = math.inf, 0, int(settings[ITERATIONS])
    better = 0  # the iteration in which the best was found
    settings[CONVERGED] = 0.0
    for count in range(most + 1):
        error = measure(work, at, settings)
        if error < best:
            best, better = error, count
            _copy_iterate(work, at[POINT], at[BEST], at)
        if error <= settings[TOLERANCE]:
            # What counts is the trajectory; where its rounding costs accuracy, the iterate must be better.
            _round_off(work, at)
            error = measure(work, at, settings)
            if error <= settings[TOLERANCE] and pairs >= 0.0:
                settings[CONVERGED] = 1.0
                break
            _copy_iterate(work, at[BEST], at[POINT], at)
            error = measure(work, at, settings)
        if not error < math.inf or count == most:
            break
        if count - better >= STUCK and best <= NEAR * settings[TOLERANCE]:
            break
        if warm and count == PATIENCE:
            begin_point(work, at, False)
            _begin_cold(work, at, settings)
            measure(work, at, settings)
        _iterate(work, at, pairs, count - better >= CYCLE or count >= LATE)
    settings[COUNT] = count
    if settings[CONVERGED] == 0.0:
        if best < math.inf:
            _copy_iterate(work, at[BEST], at[POINT], at)
            # The gains at the best iterate: those of a later one may be spoilt by rounding.
            _weigh_rows(work, at)
            factorise(work, at)
        _round_off(work, at)
        measure(work, at, settings)
    settings[REACHED] = best
    _finish_multipliers(work, at)


def _begin_cold(work, at, settings):
    """Write the optimum without limits, damped, and push it inside of the bounds."""
    begin_damped(work, at)
    measure(work, at, settings)
    factorise(work, at)
    _modify(work, at)
    substitute(work, at, False, True)
    for i in range(2 * (at[STAGES] + 1) * at[WP]):
        work[at[POINT] + i] += work[at[D_POINT] + i]
    push_inside(work, at, 0.1)
    for i in range(2 * at[STAGES] * at[MP]):
        work[at[MULTIPLIER] + i] = 0.0
    measure(work, at, settings)
    begin_pairs(work, at)


def _copy_iterate(work, source, to, at):
    """Copy points, costates, slacks and multipliers."""
    for i in range(2 * (at[STAGES] + 1) * at[WP] + 2 * at[PAIRS]):
        work[to + i] = work[source + i]


def _iterate(work, at, pairs, central):
    """Replace the iterate by the next, by a step along the central path if `central`."""
    _weigh_rows(work, at)
    factorise(work, at)
    if pairs == 0.0:
        _modify(work, at)
        substitute(work, at, False, True)
        _direct(work, at)
        _move(work, at, 1.0)
        return
    size, slack, multiplier = at[PAIRS], at[SLACK], at[MULTIPLIER]
    product, mask = at[PRODUCT], at[MASK]
    total = splat8(0.0)
    for i in range(0, size, 8):
        both = load8(work, slack + i) * load8(work, multiplier + i) * load8(work, mask + i)
        total = total + both
        store8(work, product + i, splat8(0.0) - both)
    gap = total8(total)
    _modify(work, at)
    substitute(work, at, False, False)
    _direct(work, at)
    length = min(1.0, _step_length(work, at))
    total = splat8(0.0)
    length8 = splat8(length)
    for i in range(0, size, 8):
        t = fused(length8, load8(work, at[D_SLACK] + i), load8(work, slack + i))
        z = fused(length8, load8(work, at[D_MULTIPLIER] + i), load8(work, multiplier + i))
        total = fused(t * z, load8(work, mask + i), total)
    ratio = total8(total) / gap
    correction = splat8(0.0 if central else 1.0)
    centre = splat8(max(ratio * ratio * ratio, CENTRAL if central else 0.0) * gap / pairs)
    for i in range(0, size, 8):
        t, z, exists = load8(work, slack + i), load8(work, multiplier + i), load8(work, mask + i)
        second = correction * load8(work, at[D_SLACK] + i) * load8(work, at[D_MULTIPLIER] + i)
        store8(work, product + i, (centre - t * z - second) * exists)
    _redirect(work, at)
    most = 1.0 - min(0.005, 0.5 * ratio)
    length = _central_step(work, at, min(1.0, most * _step_length(work, at)), pairs)
    if length < SHORT:
        # Pairs are too far from the central path: go there first.
        centre = splat8(0.5 * gap / pairs)
        for i in range(0, size, 8):
            t, z = load8(work, slack + i), load8(work, multiplier + i)
            store8(work, product + i, (centre - t * z) * load8(work, mask + i))
        _redirect(work, at)
        length = _central_step(work, at, min(1.0, 0.95 * _step_length(work, at)), pairs)
    _move(work, at, length)


def _central_step(work, at, length, pairs):
    """Shorten a step until no pair's product is much smaller than their mean, for which later steps would be short."""
    for _ in range(20):
        total, worst, length8 = splat8(0.0), splat8(-math.inf), splat8(length)
        for i in range(0, at[PAIRS], 8):
            t = fused(length8, load8(work, at[D_SLACK] + i), load8(work, at[SLACK] + i))
            z = fused(length8, load8(work, at[D_MULTIPLIER] + i), load8(work, at[MULTIPLIER] + i))
            both, exists = t * z, load8(work, at[MASK] + i)
            total = fused(both, exists, total)
            worst = largest8((splat8(0.0) - both) / exists, worst)
        if -_largest_lane(work, at, worst) >= APART * total8(total) / pairs:
            break
        length *= 0.9
    return length


def _redirect(work, at):
    """Write the step for PRODUCT."""
    _modify(work, at)
    substitute(work, at, True, True)
    _direct(work, at)


def _step_length(work, at):
    """Return the largest step at which no slack and no multiplier is negative, at most 1e3."""
    worst = splat8(1e-3)
    zero = splat8(0.0)
    for i in range(0, at[PAIRS], 8):
        worst = largest8((zero - load8(work, at[D_SLACK] + i)) / load8(work, at[SLACK] + i), worst)
        worst = largest8((zero - load8(work, at[D_MULTIPLIER] + i)) / load8(work, at[MULTIPLIER] + i), worst)
    return 1.0 / _largest_lane(work, at, worst)


def _largest_lane(work, at, vector):
    store8(work, at[V_WORK], vector)
    found = work[at[V_WORK]]
    for i in range(1, 8):
        found = max(found, work[at[V_WORK] + i])
    return found


def _weigh_rows(work, at):
    """Write the weight that each soft row has in the cost after slack, excess and multipliers are eliminated."""
    size = at[STAGES] * at[PP]
    slack = at[SLACK] + 2 * at[STAGES] * at[MP]
    multiplier, mask = slack - at[SLACK] + at[MULTIPLIER], slack - at[SLACK] + at[MASK]
    for i in range(0, size, 8):
        t, force = load8(work, slack + i), load8(work, multiplier + i)
        s, rest = load8(work, slack + size + i), load8(work, multiplier + size + i)
        give = s / fused(load8(work, at[SQUARE] + i), s, rest) + t / force
        store8(work, at[STEEP] + i, load8(work, mask + i) / give)


def _modify(work, at):
    """Write the gradient that is left when PRODUCT is what slacks times multipliers are to change by."""
    stages, p = at[STAGES], at[P]
    wp, mp, pp = at[WP], at[MP], at[PP]
    for i in range(0, (stages + 1) * wp, 8):
        store8(work, at[MODIFIED] + i, load8(work, at[LEFT] + i))
    bounds = stages * mp
    for k in range(stages):
        for i in range(0, mp, 8):
            place = k * mp + i
            change = load8(work, at[PRODUCT] + place) / load8(work, at[SLACK] + place)
            place += bounds
            change = load8(work, at[PRODUCT] + place) / load8(work, at[SLACK] + place) - change
            store8(work, at[MODIFIED] + k * wp + i, load8(work, at[MODIFIED] + k * wp + i) + change)
    if p == 0:
        return
    size, first = stages * pp, 2 * bounds
    for i in range(0, size, 8):
        excess = load8(work, at[SLACK] + first + size + i)
        force, rest = load8(work, at[MULTIPLIER] + first + i), load8(work, at[MULTIPLIER] + first + size + i)
        square = load8(work, at[SQUARE] + i)
        part = load8(work, at[PRODUCT] + first + size + i)
        shift = (
            load8(work, at[OFF_ROW] + i)
            - part / fused(square, excess, rest)
            + load8(work, at[PRODUCT] + first + i) / force
        )
        store8(work, at[SHIFT] + i, shift * load8(work, at[STEEP] + i))
    for k in range(stages):
        gradient, rows = at[MODIFIED] + k * wp, at[ROWS] + k * p * wp
        add_columns(work, gradient, rows, wp, at[SHIFT] + k * pp, p, at[W])


def _direct(work, at):
    """Write the steps of slacks and multipliers from that of the points."""
    stages, p, w = at[STAGES], at[P], at[W]
    wp, mp, pp = at[WP], at[MP], at[PP]
    bounds = stages * mp
    for k in range(stages):
        for i in range(0, mp, 8):
            place = k * mp + i
            step = load8(work, at[D_POINT] + k * wp + i)
            for _ in range(2):
                slack, weight = load8(work, at[SLACK] + place), load8(work, at[MULTIPLIER] + place)
                mask = load8(work, at[MASK] + place)
                store8(work, at[D_SLACK] + place, step * mask)
                change = (load8(work, at[PRODUCT] + place) - weight * step) / slack
                store8(work, at[D_MULTIPLIER] + place, change * mask)
                place += bounds
                step = splat8(0.0) - step
    if p == 0:
        return
    size, first = stages * pp, 2 * bounds
    for k in range(stages):
        values = at[V_WORK]
        for i in range(p):
            work[values + i] = 0.0
        add_rows(work, values, at[ROWS] + k * p * wp, wp, at[D_POINT] + k * wp, p, w)
        for i in range(p):
            work[at[D_MULTIPLIER] + first + k * pp + i] = work[values + i]
    for i in range(0, size, 8):
        place, other = first + i, first + size + i
        force, rest = load8(work, at[MULTIPLIER] + place), load8(work, at[MULTIPLIER] + other)
        slack, excess = load8(work, at[SLACK] + place), load8(work, at[SLACK] + other)
        mask, square = load8(work, at[MASK] + place), load8(work, at[SQUARE] + i)
        d_force = fused(load8(work, at[STEEP] + i), load8(work, at[D_MULTIPLIER] + place), load8(work, at[SHIFT] + i))
        d_force = d_force * mask
        d_excess = fused(excess, d_force, load8(work, at[PRODUCT] + other)) / fused(square, excess, rest) * mask
        store8(work, at[D_MULTIPLIER] + place, d_force)
        store8(work, at[D_SLACK] + other, d_excess)
        store8(work, at[D_MULTIPLIER] + other, (square * d_excess - d_force) * mask)
        d_slack = (load8(work, at[PRODUCT] + place) - slack * d_force) / force
        store8(work, at[D_SLACK] + place, d_slack * mask)


def _move(work, at, length):
    """Go along the step; points, costates, slacks and multipliers are one block, and so are their steps."""
    size = 2 * (at[STAGES] + 1) * at[WP] + 2 * at[PAIRS]
    length8 = splat8(length)
    for i in range(0, size, 8):
        moved = fused(length8, load8(work, at[D_POINT] + i), load8(work, at[POINT] + i))
        store8(work, at[POINT] + i, moved)
    left = splat8(1.0 - length)
    for i in range(0, at[STAGES] * at[PP], 8):
        store8(work, at[OFF_ROW] + i, left * load8(work, at[OFF_ROW] + i))


def _finish_multipliers(work, at):
    """Write the multipliers of bounds that do not exist, 0, and of those that fix a control."""
    stages, mp = at[STAGES], at[MP]
    bounds = stages * mp
    for k in range(stages):
        for i in range(at[M]):
            lower = k * mp + i
            force = work[at[MODIFIED] + k * at[WP] + i]
            if work[at[CHANGES] + lower] == 0.0:
                work[at[MULTIPLIER] + lower] = max(force, 0.0)
                work[at[MULTIPLIER] + bounds + lower] = max(-force, 0.0)
            else:
                work[at[MULTIPLIER] + lower] *= work[at[MASK] + lower]
                work[at[MULTIPLIER] + bounds + lower] *= work[at[MASK] + bounds + lower]


def _round_off(work, at):
    """Put controls inside their bounds to the last bit, and states on the trajectory that they give.

    A control makes up, by the gains of the last step, for the distance that its rounding and that of the dynamics put
    between trajectory and iterate: an unstable system would multiply it from stage to stage.
    """
    stages, n, m, w, wp = at[STAGES], at[N], at[M], at[W], at[WP]
    vector = at[V_WORK]
    for i in range(n):
        work[at[D_POINT] + m + i] = 0.0
    for k in range(stages):
        point, off = at[POINT] + k * wp, at[D_POINT] + k * wp
        for i in range(m):
            work[vector + i] = work[off + i] = 0.0
        factor = at[FACTOR] + k * (m * wp + 8)
        if k > 0:
            add_rows(work, vector, factor, wp, off, m, w)
        solve_upper(work, off, vector, factor, at[INVERSE] + k * at[MP], m, wp)
        for i in range(m):
            lowest, highest = work[at[LOWEST] + k * at[MP] + i], work[at[HIGHEST] + k * at[MP] + i]
            u = work[point + i] + work[off + i]
            if not -HUGE < u < HUGE:  # no gains, after an iteration that failed
                u = work[point + i]
            if not -HUGE < u < HUGE:
                u = 0.0
            if u < lowest:
                u = lowest
            if u > highest:
                u = highest
            work[point + i] = u
        for i in range(n):
            work[vector + i] = work[at[OFFSET] + k * at[NP] + i]
        add_rows(work, vector, at[DYNAMICS] + k * n * wp, wp, point, n, w)
        for i in range(n):
            work[off + wp + m + i] = work[vector + i] - work[point + wp + m + i]
            work[point + wp + m + i] = work[vector + i]
