"""The point of least norm in a box and an affine set, by a dual active-set method (Goldfarb and Idnani 1983)."""

from __future__ import annotations

import math

import numpy as np

from .codes import DECISIVE, PARALLEL, SLACK, STATIONARY
from .jit import compilable

__all__ = ["dual_active_set"]


@compilable()
def dual_active_set(N, k, s, lower, upper, mm, slack, push, work, active):
    """Move s (mm,) to the point of least norm in s + range N, by Goldfarb and Idnani with the identity as Hessian.

    N holds the basis vectors one after another. Return 0 if multipliers of the limits prove it, 1 and multipliers
    `push` if there is no such point, else 2.
    """
    J = work[: k * k]  # orthonormal, column by column; the first q span the active normals
    R = work[k * k : 2 * k * k]  # their triangle, column by column
    u = work[2 * k * k : 2 * k * k + k + 1]
    d = work[2 * k * k + k + 1 : 2 * k * k + 2 * k + 1]
    r = work[2 * k * k + 2 * k + 1 : 2 * k * k + 3 * k + 1]
    step = work[2 * k * k + 3 * k + 1 : 2 * k * k + 4 * k + 1]
    side = work[2 * k * k + 4 * k + 1 : 2 * k * k + 4 * k + 1 + mm]  # 0 if not active, -1 at upper, 1 at lower
    for c in range(k * k):
        J[c] = 0.0
    for c in range(k):
        J[c * k + c] = 1.0
    for c in range(mm):
        side[c] = 0.0
    q = 0
    for _ in range(10 * mm + 20):
        p, worst, sign = -1, slack, 0.0
        for i in range(mm):
            below, above = lower[i] - s[i], s[i] - upper[i]
            if side[i] == 0.0:
                if below > worst:
                    p, worst, sign = i, below, 1.0
                if above > worst:
                    p, worst, sign = i, above, -1.0
        if p < 0:
            for j in range(q):
                i = active[j]
                s[i] = lower[i] if side[i] > 0.0 else upper[i]
            return 0 if _is_optimal(N, k, s, lower, upper, mm, slack, u, side, active, q) else 2
        own = 0.0  # the multiplier of p
        while True:
            beyond = 0.0
            for c in range(k):
                total = 0.0
                for e in range(k):
                    total += J[c * k + e] * N[e * mm + p]
                d[c] = sign * total
                if c >= q:
                    beyond += total * total
            for j in range(q - 1, -1, -1):
                total = d[j]
                for e in range(j + 1, q):
                    total -= R[e * k + j] * r[e]
                r[j] = total / R[j * k + j]
            shortest, leaving = np.inf, -1
            for j in range(q):
                if r[j] > 0.0 and u[j] < shortest * r[j]:
                    shortest, leaving = u[j] / r[j], j
            independent = q < k and beyond > PARALLEL * PARALLEL
            if not independent and leaving < 0:
                push[p] = -sign
                for j in range(q):
                    push[active[j]] = side[active[j]] * r[j]
                return 1
            full = False
            length = shortest
            if independent:
                missing = lower[p] - s[p] if sign > 0.0 else s[p] - upper[p]
                if missing / beyond <= shortest:
                    length, full = missing / beyond, True
                for e in range(k):
                    step[e] = 0.0
                for c in range(q, k):
                    for e in range(k):
                        step[e] += d[c] * J[c * k + e]
                for e in range(k):
                    scale = length * step[e]
                    for i in range(mm):
                        s[i] += scale * N[e * mm + i]
            for j in range(q):
                u[j] -= length * r[j]
            own += length
            if full:
                for c in range(k - 1, q, -1):
                    if d[c] != 0.0:
                        h = math.sqrt(d[c - 1] * d[c - 1] + d[c] * d[c])
                        cos, sin = d[c - 1] / h, d[c] / h
                        d[c - 1] = h
                        for e in range(k):
                            x, y = J[(c - 1) * k + e], J[c * k + e]
                            J[(c - 1) * k + e] = cos * x + sin * y
                            J[c * k + e] = cos * y - sin * x
                for e in range(q + 1):
                    R[q * k + e] = d[e]
                u[q] = own
                active[q] = p
                side[p] = sign
                q += 1
                break
            side[active[leaving]] = 0.0
            for j in range(leaving, q - 1):
                active[j] = active[j + 1]
                u[j] = u[j + 1]
                for e in range(j + 2):
                    R[j * k + e] = R[(j + 1) * k + e]
            q -= 1
            for j in range(leaving, q):
                x, y = R[j * k + j], R[j * k + j + 1]
                h = math.sqrt(x * x + y * y)
                if h == 0.0:
                    return 2
                cos, sin = x / h, y / h
                for e in range(j, q):
                    x, y = R[e * k + j], R[e * k + j + 1]
                    R[e * k + j] = cos * x + sin * y
                    R[e * k + j + 1] = cos * y - sin * x
                for e in range(k):
                    x, y = J[j * k + e], J[(j + 1) * k + e]
                    J[j * k + e] = cos * x + sin * y
                    J[(j + 1) * k + e] = cos * y - sin * x
    return 2


@compilable()
def _is_optimal(N, k, s, lower, upper, mm, slack, u, side, active, q):
    """Return whether the multipliers u (q,) of the active limits prove that s is the point of least norm."""
    square = 0.0
    for i in range(mm):
        square += s[i] * s[i]
    size = math.sqrt(square)
    for j in range(q):
        if u[j] < -STATIONARY * size:
            return False
        i = active[j]
        # Rounding moves a limit relative to the limit itself, at most by the slack.
        if u[j] * min(slack, SLACK * max(abs(lower[i]), abs(upper[i]))) > DECISIVE * square:
            return False
    for c in range(k):
        rest = 0.0
        for i in range(mm):
            rest += N[c * mm + i] * s[i]
        for j in range(q):
            rest -= u[j] * side[active[j]] * N[c * mm + active[j]]
        if abs(rest) > STATIONARY * size:
            return False
    return True
