"""Kernel: the Newton step of all stages by a Riccati recursion.

    minimise sum of 1/2 dz' H dz + f' dz over the stages,  dx+ = G dz + e,  dx = 0 at the start

Backward, with P and p of the cost to go 1/2 dx' P dx + p' dx of the next stage:

    M = H + G' P G,    M = [U_uu U_ux]' [U_uu U_ux] + [0, P of this stage]    (Cholesky's method, stopped after u)

Forward, du = -inv(U_uu) (U_ux dx + zeta) and dy = P dx + p.
"""

import math

from .layout import (
    CHANGES,
    COST,
    COST_GAP,
    COST_GRADIENT,
    D_COSTATE,
    D_POINT,
    DYNAMICS,
    FACTOR,
    FLAT,
    GAP,
    HESSIAN,
    HUGE,
    INVERSE,
    M_WORK,
    MASK,
    MODIFIED,
    MP,
    MULTIPLIER,
    NP,
    PP,
    R_WORK,
    REDUCED,
    ROWS,
    S_WORK,
    SLACK,
    STAGES,
    STEEP,
    T_WORK,
    TILE,
    V_WORK,
    WP,
    M,
    N,
    P,
    W,
)
from .products import add_columns, add_rows, multiply
from .vectors import fused, load8, splat8, store8


def factorise(work, at):
    """Write matrices of the cost to go and factors of all stages; slacks and multipliers are weights of controls."""
    stages, n, m, p, w = at[STAGES], at[N], at[M], at[P], at[W]
    np_, mp, pp, wp = at[NP], at[MP], at[PP], at[WP]
    size = max(n, TILE) * np_ + 8  # vectors write a few numbers beyond the last row
    matrix, reduced, forces = at[T_WORK], at[M_WORK], at[R_WORK]
    last = at[HESSIAN] + stages * w * wp + m * wp + m
    _copy_symmetric(work, at[COST] + stages * size, np_, last, wp, n)
    for k in range(stages - 1, -1, -1):
        hessian, dynamics, rows = at[HESSIAN] + k * w * wp, at[DYNAMICS] + k * n * wp, at[ROWS] + k * p * wp
        # At the start the state is given, so that only the controls' part is needed.
        width = w if k > 0 else m
        multiply(work, matrix, wp, -1, 0, 1.0, at[COST] + (k + 1) * size, np_, dynamics, wp, n, width, n, False)
        into = reduced if p == 0 else at[S_WORK]
        multiply(work, into, wp, hessian, wp, 1.0, dynamics, wp, matrix, wp, width, width, n, True)
        if p > 0:
            for j in range(p):
                weight = splat8(work[at[STEEP] + k * pp + j])
                for i in range(0, wp, 8):
                    store8(work, forces + j * wp + i, weight * load8(work, rows + j * wp + i))
            # To another place: tiles overlap, and would add twice.
            multiply(work, reduced, wp, at[S_WORK], wp, 1.0, rows, wp, forces, wp, width, width, p, True)
        for i in range(m):
            lower = k * mp + i
            upper = lower + stages * mp
            weight = work[at[MASK] + lower] * work[at[MULTIPLIER] + lower] / work[at[SLACK] + lower]
            weight += work[at[MASK] + upper] * work[at[MULTIPLIER] + upper] / work[at[SLACK] + upper]
            if work[at[CHANGES] + lower] == 0.0:
                weight = HUGE
            work[reduced + i * wp + i] += weight
        factor = at[FACTOR] + k * (m * wp + 8)
        _eliminate(work, reduced, factor, at[INVERSE] + k * mp, m, width, wp)
        if k > 0:
            cost = at[COST] + k * size
            multiply(work, cost, np_, reduced + m * wp + m, wp, -1.0, factor + m, wp, factor + m, wp, n, n, m, True)
            for i in range(1, n):
                for j in range(i):
                    work[cost + i * np_ + j] = work[cost + j * np_ + i]


def _copy_symmetric(work, to, to_step, source, step, n):
    """Copy a matrix from its upper half."""
    for i in range(n):
        for j in range(i, n):
            work[to + i * to_step + j] = work[to + j * to_step + i] = work[source + i * step + j]


def _eliminate(work, matrix, factor, inverse, m, width, step):
    """Write the first m rows of the Cholesky factor; its rows follow the upper half of the matrix."""
    for i in range(m):
        row, diagonal = factor + i * step, matrix + i * step + i
        before = work[diagonal]
        for column in range(i, width, 8):
            sums = load8(work, matrix + i * step + column)
            for j in range(i):
                sums = fused(-work[factor + j * step + i], load8(work, factor + j * step + column), sums)
            store8(work, row + column, sums)
        pivot = work[row + i]
        if not pivot > FLAT * before:
            pivot = HUGE
        scale = 1.0 / math.sqrt(pivot)
        work[inverse + i] = scale
        scales = splat8(scale)
        for column in range(i, width, 8):
            store8(work, row + column, scales * load8(work, row + column))


def substitute(work, at, again, costates):
    """Write the step of points and costates for the gradients MODIFIED and the errors GAP.

    If `again`, the errors and matrices are those of the call before.
    """
    stages, n, m, w = at[STAGES], at[N], at[M], at[W]
    np_, mp, wp = at[NP], at[MP], at[WP]
    size = max(n, TILE) * np_ + 8  # vectors write a few numbers beyond the last row
    vector = at[V_WORK]
    for i in range(n):
        work[at[COST_GRADIENT] + stages * np_ + i] = work[at[MODIFIED] + stages * wp + m + i]
    for k in range(stages - 1, -1, -1):
        ahead = (k + 1) * np_
        if not again:
            for i in range(0, np_, 8):
                store8(work, at[COST_GAP] + ahead + i, splat8(0.0))
            cost = at[COST] + (k + 1) * size
            add_columns(work, at[COST_GAP] + ahead, cost, np_, at[GAP] + ahead, n, n)
        for i in range(0, np_, 8):
            both = load8(work, at[COST_GAP] + ahead + i) + load8(work, at[COST_GRADIENT] + ahead + i)
            store8(work, vector + i, both)
        gradient, factor = at[MODIFIED] + k * wp, at[FACTOR] + k * (m * wp + 8)
        width = w if k > 0 else m
        add_columns(work, gradient, at[DYNAMICS] + k * n * wp, wp, vector, n, width)
        for i in range(m):
            zeta = work[gradient + i] * work[at[INVERSE] + k * mp + i]
            work[at[REDUCED] + k * mp + i] = zeta
            for column in range(i + 1, width, 8):
                left = fused(-zeta, load8(work, factor + i * wp + column), load8(work, gradient + column))
                store8(work, gradient + column, left)
        for i in range(n):
            work[at[COST_GRADIENT] + k * np_ + i] = work[gradient + m + i]
    for i in range(w):
        work[at[D_POINT] + i] = 0.0
    for k in range(stages):
        point, factor = at[D_POINT] + k * wp, at[FACTOR] + k * (m * wp + 8)
        for i in range(m):
            work[vector + i] = work[at[REDUCED] + k * mp + i]
            work[point + i] = 0.0
        if k > 0:
            add_rows(work, vector, factor, wp, point, m, w)
        solve_upper(work, point, vector, factor, at[INVERSE] + k * mp, m, wp)
        following = point + wp + m
        for i in range(n):
            work[following + i] = work[at[GAP] + (k + 1) * np_ + i]
        add_rows(work, following, at[DYNAMICS] + k * n * wp, wp, point, n, w)
        costate = at[D_COSTATE] + (k + 1) * wp + m
        if costates:
            for i in range(n):
                work[costate + i] = work[at[COST_GRADIENT] + (k + 1) * np_ + i]
            add_symmetric(work, costate, at[COST] + (k + 1) * size, np_, following, n)


def add_symmetric(work, out, x, x_step, v, n):
    """Add X v to n numbers that others follow; X is symmetric."""
    for column in range(0, n - 7, 8):
        sums, at = load8(work, out + column), x + column
        for i in range(n):
            sums = fused(work[v + i], load8(work, at), sums)
            at += x_step
        store8(work, out + column, sums)
    for column in range(n - n % 8, n):
        total = work[out + column]
        for i in range(n):
            total += work[x + i * x_step + column] * work[v + i]
        work[out + column] = total


def solve_upper(work, out, vector, factor, inverse, m, step):
    """Write -inv(U) v; the vector v is overwritten."""
    for i in range(m - 1, -1, -1):
        entry = -work[vector + i] * work[inverse + i]
        work[out + i] = entry
        for j in range(i):
            work[vector + j] += work[factor + j * step + i] * entry
