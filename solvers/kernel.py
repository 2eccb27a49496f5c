r"""Bounded least norm in the null space of the wrench matrix, for Numba: behind "active-set" and `solve_batch`.

.. math::

    \min_s |s|^2 \quad \text{s.t.} \quad B s = b, \; lower \le s \le upper, \qquad s = s_0 + N z

B is reduced by Householder reflections from the right with row pivoting (B = P^T L Q_1^T; Golub and Van Loan, 5.4).
That gives the least-norm s_0, orthogonal to the orthonormal null-space basis N; what remains is the z of least norm
inside slabs, one for each cable. In up to two dimensions the slabs are taken one after another (Seidel 1991): an
optimum that the next slab forbids moves onto its edge, cut to an interval by the slabs before. Beyond two dimensions a
dual active-set method (Goldfarb and Idnani 1983) adds the most violated limit and drops those whose multiplier would
change sign.

Nothing here is believed that the data do not confirm. Tensions count only if, inside their limits, their wrench error
is below `TensionProblem.tolerance`; a direction only if its support value falls short of the demand by more than that.
Near the boundary, near the rank cut, or if rounding makes the iteration lose its way, the answer is UNSURE and whoever
asked goes to the robust path of `registry.py`.

This file imports Numba: it is imported by `compiled.py` alone, where it is needed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from .tolerances import FEASIBILITY, NEGLIGIBLE, RANK, ROUNDING

__all__ = ["INFEASIBLE", "INVALID", "OPTIMAL", "SINGULAR", "UNSURE", "solve_packed", "solve_rows"]

OPTIMAL, INFEASIBLE, SINGULAR, UNSURE, INVALID = 0, 1, 2, 3, 4

# Pivots above the first part of the largest are sure to count, below the second they are rounding. RANK lies between.
_SURE_PIVOT, _SURE_ZERO = 1e-9, 1e-14

_SLACK = 1e-12  # how far s may pass a limit, relative to the size of s
_PARALLEL = 1e-11  # sine and length below which a slab does not cut a line
_DEPENDENT = 1e-22  # square of the part of a normal outside the span of the active ones
_CLEAR = 4.0  # a shortfall is beyond doubt from this many tolerances


def _jit(*arguments: Any, **options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Compile without the GIL, kept on the disk where Numba finds a folder that can be written."""
    settings = {"nogil": True, "error_model": "numpy", **options}

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        try:
            return numba.njit(*arguments, cache=True, **settings)(function)
        except (RuntimeError, OSError):
            return numba.njit(*arguments, **settings)(function)

    return decorate


@_jit()
def work_size(n: int, m: int) -> int:
    """Return how many numbers of scratch one problem needs."""
    return n * m + 6 * n + 6 * m + (m * m + 2 * m) + (2 * m * m + 6 * m + 2) + n * n + n


@_jit()
def _reflect(B, tau, j, mm, x, at):  # x[at:at+mm] -= tau v v^T x, v = B[j, j:]
    dot = 0.0
    for c in range(j, mm):
        dot += B[j * mm + c] * x[at + c]
    dot *= tau[j]
    for c in range(j, mm):
        x[at + c] -= dot * B[j * mm + c]


@_jit()
def _reduce(B, n, mm, order, diag, tau, norms):
    """Reduce B (n, mm) in place to L and reflectors, largest remaining row first; return the rank, or -1 if unsure."""
    for i in range(n):
        total = 0.0
        for c in range(mm):
            total += B[i * mm + c] * B[i * mm + c]
        norms[i] = total
        order[i] = i
    steps = min(n, mm)
    for j in range(steps):
        best = j
        for i in range(j + 1, n):
            if norms[i] > norms[best]:
                best = i
        if j > 0 and norms[best] <= 1e-12 * diag[0] * diag[0]:
            # The norms are kept by subtraction, which has no digits left this far down.
            for i in range(j, n):
                total = 0.0
                for c in range(j, mm):
                    total += B[i * mm + c] * B[i * mm + c]
                norms[i] = total
                if total > norms[best] or i == j:
                    best = i
        if best != j:
            for c in range(mm):
                B[j * mm + c], B[best * mm + c] = B[best * mm + c], B[j * mm + c]
            norms[best] = norms[j]
            order[j], order[best] = order[best], order[j]
        total = 0.0
        for c in range(j, mm):
            total += B[j * mm + c] * B[j * mm + c]
        length = math.sqrt(total)
        if j == 0 and length == 0.0:
            return 0
        if j > 0 and length <= _SURE_PIVOT * abs(diag[0]):
            return j if length <= _SURE_ZERO * abs(diag[0]) else -1
        head = B[j * mm + j]
        pivot = -length if head > 0.0 else length
        diag[j] = pivot
        B[j * mm + j] = head - pivot
        tau[j] = -1.0 / (pivot * (head - pivot))
        for i in range(j + 1, n):
            dot = 0.0
            for c in range(j, mm):
                dot += B[j * mm + c] * B[i * mm + c]
            dot *= tau[j]
            for c in range(j, mm):
                B[i * mm + c] -= dot * B[j * mm + c]
            norms[i] -= B[i * mm + j] * B[i * mm + j]
    return steps


@_jit()
def _planar(N0, N1, s0, lower, upper, mm, slack, z, push):
    """Find the z of least norm in up to two dimensions; False and multipliers `push` if there is none."""
    z0, z1 = 0.0, 0.0
    for i in range(mm):
        a, b = N0[i], N1[i]
        value = s0[i] + a * z0 + b * z1
        if value < lower[i] - slack:
            edge, side = lower[i] - s0[i], -1.0
        elif value > upper[i] + slack:
            edge, side = upper[i] - s0[i], 1.0
        else:
            continue
        square = a * a + b * b
        if square < _PARALLEL * _PARALLEL:
            push[i] = side
            return False
        length = math.sqrt(square)
        along0, along1 = -b / length, a / length
        base0, base1 = a * edge / square, b * edge / square
        first, last = -np.inf, np.inf
        at_first, at_last = -1, -1
        den_first, den_last = 0.0, 0.0
        for j in range(i):
            den = N0[j] * along0 + N1[j] * along1
            here = s0[j] + N0[j] * base0 + N1[j] * base1
            low, high = lower[j] - here, upper[j] - here
            if abs(den) < _PARALLEL:
                if low > slack or high < -slack:
                    push[j] = -1.0 if low > slack else 1.0
                    push[i] = -push[j] * (N0[j] * a + N1[j] * b) / square
                    return False
                continue
            if den < 0.0:
                low, high = high, low
            low /= den
            high /= den
            if low > first:
                first, at_first, den_first = low, j, den
            if high < last:
                last, at_last, den_last = high, j, den
        if first > last:
            if first - last > slack:
                # The limit that stops from below and the one from above, such that their pulls along the edge cancel.
                f = -math.copysign(abs(den_last), den_first)
                g = math.copysign(abs(den_first), den_last)
                push[at_first] += f
                push[at_last] += g
                toward = f * (N0[at_first] * a + N1[at_first] * b) + g * (N0[at_last] * a + N1[at_last] * b)
                push[i] -= toward / square
                return False
            shift = 0.5 * (first + last)
        else:
            shift = min(max(0.0, first), last)
        z0, z1 = base0 + shift * along0, base1 + shift * along1
    z[0], z[1] = z0, z1
    return True


@_jit()
def _dual_active_set(N, k, s, lower, upper, mm, slack, push, work, active):
    """Move s (mm,) to the point of least norm in s + range N, by Goldfarb and Idnani with the identity as Hessian.

    N holds the basis vectors one after another. Return 0 if found, 1 and multipliers `push` if there is none, else 2.
    """
    J = work[: k * k]  # orthonormal, column by column; the first q span the active normals
    R = work[k * k : 2 * k * k]  # their triangle, column by column
    u = work[2 * k * k : 2 * k * k + k + 1]
    d = work[2 * k * k + k + 1 : 2 * k * k + 2 * k + 1]
    r = work[2 * k * k + 2 * k + 1 : 2 * k * k + 3 * k + 1]
    step = work[2 * k * k + 3 * k + 1 : 2 * k * k + 4 * k + 1]
    side = work[2 * k * k + 4 * k + 1 : 2 * k * k + 4 * k + 1 + mm]  # 0 if not active, -1 at upper, 1 at lower
    J[:] = 0.0
    for c in range(k):
        J[c * k + c] = 1.0
    side[:] = 0.0
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
            return 0
        own = 0.0  # the multiplier of p
        size = 0.0
        for c in range(k):
            size += N[c * mm + p] * N[c * mm + p]
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
            independent = q < k and beyond > _DEPENDENT * max(size, _PARALLEL * _PARALLEL)
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


@_jit()
def _proves(A, w, lower, upper, ref, n, m, per_length, d, info):
    """Whether the scaled direction d (n,), made unit and unscaled here, proves w out of reach.

    Return INFEASIBLE, SINGULAR if no cable pulls along it, or UNSURE; info gets support and shortfall.
    """
    total = 0.0
    for i in range(n):
        total += d[i] * d[i]
    if not 0.0 < total < np.inf:
        return UNSURE
    total = 1.0 / math.sqrt(total)
    demand, asked = 0.0, 0.0
    for i in range(n):
        scale = per_length if n == 6 and i >= 3 else 1.0
        d[i] *= total * scale
        demand += d[i] * w[i]
        asked += (scale * w[i]) * (scale * w[i])
    asked = math.sqrt(asked)
    rounding, largest = 0.0, 0.0
    for c in range(m):
        square = 0.0
        for i in range(n):
            x = A[i * m + c] * (per_length if n == 6 and i >= 3 else 1.0)
            square += x * x
        largest = max(largest, square)
        norm = math.sqrt(square)
        nearest = abs(min(max(lower[c], 0.0), upper[c]))
        asked += norm * nearest
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
    if not demand - support > _CLEAR * (FEASIBILITY * asked + ROUNDING * rounding):
        return UNSURE
    return status


@_jit()
def _outside_range(A, w, n, m, per_length, d, work):
    """Put the part of S w outside the range of S A into d (n,); False if it is rounding. By Gram-Schmidt, twice."""
    Q, x = work[: n * n], work[n * n : n * n + n]
    used = np.zeros(m, np.bool_)
    largest, rank = 0.0, 0
    for _ in range(min(n, m)):
        best, most = -1, 0.0
        for c in range(m):
            if used[c]:
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
        used[best] = True
        rank += 1
    before = 0.0
    for i in range(n):
        d[i] = w[i] * (per_length if n == 6 and i >= 3 else 1.0)
        before += d[i] * d[i]
    if rank == n:
        return False
    return _without(Q, rank, n, d) > 1e-20 * before


@_jit()
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


@_jit()
def _solve(A, w, lower, upper, ref, weights, length, n, m, t, d, info, work):
    """Solve one problem of flat arrays; A (n m,) row by row. Return the status.

    t (m,) gets the tensions, d (n,) the certificate's direction, info (3,) support, shortfall and wrench error.
    """
    per_length = 1.0 / length
    at = 0
    B = work[at : at + n * m]
    at += n * m
    b, diag, tau, norms, y = (
        work[at : at + n],
        work[at + n :],
        work[at + 2 * n :],
        work[at + 3 * n :],
        work[at + 4 * n :],
    )
    at += 6 * n
    low, high, s = work[at : at + m], work[at + m : at + 2 * m], work[at + 2 * m : at + 3 * m]
    unit, push = work[at + 3 * m : at + 4 * m], work[at + 4 * m : at + 5 * m]
    at += 5 * m
    N = work[at : at + m * m + 2 * m]
    at += m * m + 2 * m
    rest = work[at:]
    integers = np.empty(n + 2 * m, np.int64)
    order, moving, active = integers[:n], integers[n : n + m], integers[n + m :]

    heaviest = 0.0
    for c in range(m):
        heaviest = max(heaviest, weights[c])
    mm = 0
    size = 0.0
    for c in range(m):
        if lower[c] < upper[c]:
            moving[mm] = c
            omega = weights[c]
            scale = 1.0 if omega == heaviest else math.sqrt(heaviest / omega)
            unit[mm] = scale
            low[mm] = (lower[c] - ref[c]) / scale
            high[mm] = (upper[c] - ref[c]) / scale
            size = max(size, abs(min(max(low[mm], 0.0), high[mm])))
            t[c] = ref[c]
            mm += 1
        else:
            t[c] = lower[c]
    required, asked = 0.0, 0.0
    for i in range(n):
        scale = per_length if n == 6 and i >= 3 else 1.0
        total = w[i]
        required += (scale * total) * (scale * total)
        for c in range(m):
            total -= A[i * m + c] * t[c]
        b[i] = total * scale
        for c in range(mm):
            B[i * mm + c] = A[i * m + moving[c]] * scale * unit[c]

    rank = _reduce(B, n, mm, order, diag, tau, norms) if mm else 0
    if rank < 0:
        return UNSURE
    total = 0.0
    for j in range(rank):
        x = b[order[j]]
        for i in range(j):
            x -= B[j * mm + i] * y[i]
        y[j] = x / diag[j]
        total += y[j] * y[j]
        s[j] = y[j]
    size = max(size, math.sqrt(total))
    slack = _SLACK * size
    for c in range(rank, mm):
        s[c] = 0.0
    for j in range(rank - 1, -1, -1):
        _reflect(B, tau, j, mm, s, 0)

    outside = False
    for c in range(mm):
        push[c] = 0.0
        if s[c] < low[c] - slack or s[c] > high[c] + slack:
            outside = True
    found = 0
    k = mm - rank
    if outside:
        N[: max(k, 2) * mm] = 0.0
        for c in range(k):
            N[c * mm + rank + c] = 1.0
            for j in range(rank - 1, -1, -1):
                _reflect(B, tau, j, mm, N, c * mm)
        if k <= 2:
            z = rest[:2]
            if _planar(N[:mm], N[mm : 2 * mm], s, low, high, mm, slack, z, push):
                for c in range(mm):
                    s[c] += N[c] * z[0] + N[mm + c] * z[1]
            else:
                found = 1
        else:
            found = _dual_active_set(N, k, s, low, high, mm, slack, push, rest, active)
    if found == 0:
        for c in range(mm):
            i = moving[c]
            t[i] += unit[c] * s[c]
        asked = math.sqrt(required)
        rounding, error = 0.0, 0.0
        for c in range(m):
            t[c] = min(max(t[c], lower[c]), upper[c])
            square = 0.0
            for i in range(n):
                x = A[i * m + c] * (per_length if n == 6 and i >= 3 else 1.0)
                square += x * x
            norm = math.sqrt(square)
            asked += norm * abs(min(max(lower[c], 0.0), upper[c]))
            rounding += norm * (abs(t[c]) + abs(ref[c]))
        for i in range(n):
            total = -w[i]
            for c in range(m):
                total += A[i * m + c] * t[c]
            if n == 6 and i >= 3:
                total *= per_length
            error += total * total
        info[2] = math.sqrt(error)
        if info[2] <= FEASIBILITY * asked + ROUNDING * rounding:
            return OPTIMAL
    if found == 2:
        return UNSURE
    # A part of w outside the range of A makes the problem singular, whatever else is wrong with it.
    if rank < n and _outside_range(A, w, n, m, per_length, d, rest):
        return SINGULAR if _proves(A, w, lower, upper, ref, n, m, per_length, d, info) == SINGULAR else UNSURE
    if found == 0:
        return UNSURE
    # push = B^T d, and push is in the row space of B.
    for j in range(rank):
        _reflect(B, tau, j, mm, push, 0)
    for j in range(rank - 1, -1, -1):
        x = push[j]
        for i in range(j + 1, rank):
            x -= B[i * mm + j] * y[i]
        y[j] = x / diag[j]
    for i in range(n):
        d[order[i]] = y[i] if i < rank else 0.0
    verdict = _proves(A, w, lower, upper, ref, n, m, per_length, d, info)
    return INFEASIBLE if verdict == INFEASIBLE else UNSURE


_VECTOR = numba.float64[::1]
_GIVEN = numba.types.Array(numba.float64, 1, "C", readonly=True)


@_jit(numba.int64(_GIVEN, numba.int64, numba.int64, _VECTOR))
def solve_packed(data, n, m, t):
    """Solve one problem given as one array: A row by row, w, t_min, t_max, t_ref, weights, length. Return its status.

    Parameters
    ----------
    data :
        Shape (n m + n + 5 m + 1,).
    n, m :
        Wrench rows and cables.
    t :
        Gets the tensions, shape (m,).
    """
    at = n * m + n
    work = np.empty(work_size(n, m) + n + 3)
    return _solve(
        data[: n * m],
        data[n * m : at],
        data[at : at + m],
        data[at + m : at + 2 * m],
        data[at + 2 * m : at + 3 * m],
        data[at + 3 * m : at + 4 * m],
        data[at + 4 * m],
        n,
        m,
        t,
        work[:n],
        work[n : n + 3],
        work[n + 3 :],
    )


# Lanes: this many problems at once, number e of each row of scratch belonging to problem e. One array holds everything,
# fixed rows first, then a block for each cable, one for each wrench row, and B: few checks for overlap are left to
# LLVM, which then makes vector instructions of the loops.
_LANES = 32
_Z0, _Z1, _ALONG0, _ALONG1, _BASE0, _BASE1, _FIRST, _LAST, _GOOD, _MOVES = range(10)
_SLACKS, _SIZE, _DOT0, _DOT1, _DOT2, _ASKED, _ROUNDING, _REQUIRED = range(10, 18)
_FIXED = 18
_N0, _N1, _S, _LOW, _HIGH, _REF, _UNIT, _T, _T_LOW, _T_HIGH = range(10)
_PER_CABLE = 10
_DIAG, _TAU, _Y, _W = range(4)
_PER_WRENCH = 4


@_jit()
def _lanes(A, w, lower, upper, ref, weights, length, per, n, m, first, count, t, info, status, W):
    """Solve the problems first to first + count if nothing is in doubt; mark the others UNSURE."""
    L = _LANES
    cable0 = _FIXED
    wrench0 = cable0 + m * _PER_CABLE
    B0 = wrench0 + n * _PER_WRENCH
    weighted = weights.shape[0] > 1
    for e in range(count):
        row = first + e
        per_length = 1.0 / length[row * per[6]]
        at_A, at_w, at_low, at_high, at_ref = row * per[0], row * per[1], row * per[2], row * per[3], row * per[4]
        for r in range(n):
            scale = per_length if n == 6 and r >= 3 else 1.0
            W[wrench0 + (r * _PER_WRENCH + _W), e] = scale * w[at_w + r]
            for c in range(m):
                W[B0 + (r * m + c), e] = scale * A[at_A + r * m + c]
        for c in range(m):
            block = cable0 + c * _PER_CABLE
            W[block + _T_LOW, e] = lower[at_low + c]
            W[block + _T_HIGH, e] = upper[at_high + c]
            W[block + _REF, e] = ref[at_ref + c]
        heaviest = 0.0
        if weighted:
            at = row * per[5]
            for c in range(m):
                heaviest = max(heaviest, weights[at + c])
            for c in range(m):
                omega = weights[at + c]
                W[cable0 + (c * _PER_CABLE + _UNIT), e] = math.sqrt(heaviest / omega) if omega > 0.0 else np.nan
    for x in range(_FIXED + m * _PER_CABLE + n * (_PER_WRENCH + m)):
        for e in range(count, L):
            W[x, e] = W[x, 0]

    for e in range(L):
        W[_ASKED, e] = 0.0
        W[_ROUNDING, e] = 0.0
        W[_REQUIRED, e] = 0.0
        W[_SIZE, e] = 0.0
        W[_GOOD, e] = 1.0
    for r in range(n):
        row = wrench0 + r * _PER_WRENCH
        for e in range(L):
            x = W[row + _W, e]
            W[_REQUIRED, e] += x * x
            W[row + _Y, e] = x
    for e in range(L):
        W[_ASKED, e] = math.sqrt(W[_REQUIRED, e])
    for c in range(m):
        block = cable0 + c * _PER_CABLE
        for e in range(L):
            W[_DOT0, e] = 0.0
        for r in range(n):
            row, y = B0 + (r * m + c), wrench0 + (r * _PER_WRENCH + _Y)
            for e in range(L):
                x = W[row, e]
                W[_DOT0, e] += x * x
                W[y, e] -= x * W[block + _REF, e]
        if not weighted:
            for e in range(L):
                W[block + _UNIT, e] = 1.0
        for e in range(L):
            low, high, ref_c = W[block + _T_LOW, e], W[block + _T_HIGH, e], W[block + _REF, e]
            norm = math.sqrt(W[_DOT0, e])
            nearest = low if low > 0.0 else 0.0
            nearest = high if high < nearest else nearest
            W[_ASKED, e] += norm * abs(nearest)
            W[_ROUNDING, e] += norm * abs(ref_c)
            W[block + _N0, e] = norm
            unit = W[block + _UNIT, e]
            low = (low - ref_c) / unit
            high = (high - ref_c) / unit
            W[block + _LOW, e] = low
            W[block + _HIGH, e] = high
            nearest = low if low > 0.0 else 0.0
            nearest = abs(high if high < nearest else nearest)
            size = W[_SIZE, e]
            W[_SIZE, e] = nearest if nearest > size else size
            good = W[block + _T_LOW, e] <= W[block + _T_HIGH, e] and norm < 1e50
            W[_GOOD, e] = W[_GOOD, e] if good else 0.0
            W[block + _T, e] = norm
        if weighted:
            for r in range(n):
                row = B0 + (r * m + c)
                for e in range(L):
                    W[row, e] *= W[block + _UNIT, e]

    for j in range(n):
        own = wrench0 + j * _PER_WRENCH
        for e in range(L):
            W[_DOT0, e] = 0.0
            W[_DOT1, e] = 0.0
        for c in range(j):
            row = B0 + (j * m + c)
            for e in range(L):
                W[_DOT1, e] += W[row, e] * W[row, e]
        for c in range(j, m):
            row = B0 + (j * m + c)
            for e in range(L):
                W[_DOT0, e] += W[row, e] * W[row, e]
        row = B0 + (j * m + j)
        for e in range(L):
            square, head = W[_DOT0, e], W[row, e]
            if j == 0:
                W[_DOT2, e] = square
            largest = W[_DOT2, e]
            good = square > 1e-10 * W[_DOT1, e] and square > 1e-10 * largest and square < 1e10 * largest
            W[_GOOD, e] = W[_GOOD, e] if good else 0.0
            square = square if good else 1.0
            norm = math.sqrt(square)
            pivot = -norm if head > 0.0 else norm
            W[own + _DIAG, e] = pivot
            W[row, e] = head - pivot
            W[own + _TAU, e] = -1.0 / (pivot * (head - pivot))
        for i in range(j + 1, n):
            for e in range(L):
                W[_DOT0, e] = 0.0
            for c in range(j, m):
                v, x = B0 + (j * m + c), B0 + (i * m + c)
                for e in range(L):
                    W[_DOT0, e] += W[v, e] * W[x, e]
            for e in range(L):
                W[_DOT0, e] *= W[own + _TAU, e]
            for c in range(j, m):
                v, x = B0 + (j * m + c), B0 + (i * m + c)
                for e in range(L):
                    W[x, e] -= W[_DOT0, e] * W[v, e]
    for e in range(L):
        W[_DOT0, e] = 0.0
    for j in range(n):
        own = wrench0 + j * _PER_WRENCH
        for i in range(j):
            x, y = B0 + (j * m + i), wrench0 + (i * _PER_WRENCH + _Y)
            for e in range(L):
                W[own + _Y, e] -= W[x, e] * W[y, e]
        block = cable0 + j * _PER_CABLE
        for e in range(L):
            y = W[own + _Y, e] / W[own + _DIAG, e]
            W[own + _Y, e] = y
            W[_DOT0, e] += y * y
            W[block + _S, e] = y
    for e in range(L):
        size, other = W[_SIZE, e], math.sqrt(W[_DOT0, e])
        W[_SLACKS, e] = _SLACK * (size if size > other else other)
    for c in range(m):
        block = cable0 + c * _PER_CABLE
        for e in range(L):
            if c >= n:
                W[block + _S, e] = 0.0
            W[block + _N0, e] = 1.0 if c == n else 0.0
            W[block + _N1, e] = 1.0 if c == n + 1 else 0.0
    for j in range(n - 1, -1, -1):
        own = wrench0 + j * _PER_WRENCH
        for e in range(L):
            W[_DOT0, e] = 0.0
            W[_DOT1, e] = 0.0
            W[_DOT2, e] = 0.0
        for c in range(j, m):
            v, block = B0 + (j * m + c), cable0 + c * _PER_CABLE
            for e in range(L):
                x = W[v, e]
                W[_DOT0, e] += x * W[block + _N0, e]
                W[_DOT1, e] += x * W[block + _N1, e]
                W[_DOT2, e] += x * W[block + _S, e]
        for e in range(L):
            tau = W[own + _TAU, e]
            W[_DOT0, e] *= tau
            W[_DOT1, e] *= tau
            W[_DOT2, e] *= tau
        for c in range(j, m):
            v, block = B0 + (j * m + c), cable0 + c * _PER_CABLE
            for e in range(L):
                W[block + _N0, e] -= W[v, e] * W[_DOT0, e]
            for e in range(L):
                W[block + _N1, e] -= W[v, e] * W[_DOT1, e]
            for e in range(L):
                W[block + _S, e] -= W[v, e] * W[_DOT2, e]

    for e in range(L):
        W[_Z0, e] = 0.0
        W[_Z1, e] = 0.0
    for i in range(m):
        own = cable0 + i * _PER_CABLE
        for e in range(L):
            a, b, s = W[own + _N0, e], W[own + _N1, e], W[own + _S, e]
            low, high, slack = W[own + _LOW, e], W[own + _HIGH, e], W[_SLACKS, e]
            value = s + a * W[_Z0, e] + b * W[_Z1, e]
            below = value < low - slack
            above = value > high + slack
            edge = (low if below else high) - s
            square = a * a + b * b
            cuts = square > _PARALLEL * _PARALLEL
            square = square if cuts else 1.0
            inverse = 1.0 / square
            root = math.sqrt(inverse)
            W[_MOVES, e] = 1.0 if below or above else 0.0
            good = W[_GOOD, e]
            good = good if cuts else 0.0
            W[_GOOD, e] = good if below or above else W[_GOOD, e]
            W[_ALONG0, e] = -b * root
            W[_ALONG1, e] = a * root
            W[_BASE0, e] = a * edge * inverse
            W[_BASE1, e] = b * edge * inverse
            W[_FIRST, e] = -np.inf
            W[_LAST, e] = np.inf
        for j in range(i):
            block = cable0 + j * _PER_CABLE
            for e in range(L):
                a, b = W[block + _N0, e], W[block + _N1, e]
                here = W[block + _S, e] + a * W[_BASE0, e] + b * W[_BASE1, e]
                low, high = W[block + _LOW, e] - here, W[block + _HIGH, e] - here
                den = a * W[_ALONG0, e] + b * W[_ALONG1, e]
                parallel = abs(den) < _PARALLEL
                slack = W[_SLACKS, e]
                inside = low <= slack and high >= -slack
                inverse = 1.0 / (1.0 if parallel else den)
                low *= inverse
                high *= inverse
                start = high if den < 0.0 else low
                stop = low if den < 0.0 else high
                start = (-np.inf if inside else np.inf) if parallel else start
                stop = np.inf if parallel else stop
                before, after = W[_FIRST, e], W[_LAST, e]
                W[_FIRST, e] = start if start > before else before
                W[_LAST, e] = stop if stop < after else after
        for e in range(L):
            start, stop = W[_FIRST, e], W[_LAST, e]
            moves = W[_MOVES, e] > 0.0
            good = W[_GOOD, e]
            W[_GOOD, e] = 0.0 if moves and start - stop > W[_SLACKS, e] else good
            shift = start if start > 0.0 else 0.0
            shift = stop if stop < shift else shift
            shift = 0.5 * (start + stop) if start > stop else shift
            z0 = W[_BASE0, e] + shift * W[_ALONG0, e]
            z1 = W[_BASE1, e] + shift * W[_ALONG1, e]
            W[_Z0, e] = z0 if moves else W[_Z0, e]
            W[_Z1, e] = z1 if moves else W[_Z1, e]

    for c in range(m):
        block = cable0 + c * _PER_CABLE
        for e in range(L):
            s = W[block + _S, e] + W[block + _N0, e] * W[_Z0, e] + W[block + _N1, e] * W[_Z1, e]
            x = W[block + _REF, e] + W[block + _UNIT, e] * s
            low, high = W[block + _T_LOW, e], W[block + _T_HIGH, e]
            x = low if x < low else x
            x = high if x > high else x
            W[_ROUNDING, e] += W[block + _T, e] * abs(x)
            W[block + _T, e] = x
    for e in range(count):
        row = first + e
        good = W[_GOOD, e] > 0.0 and W[_REQUIRED, e] < 1e100
        if good:
            per_length = 1.0 / length[row * per[6]]
            at_A = row * per[0]
            for c in range(m):
                t[row * m + c] = W[cable0 + (c * _PER_CABLE + _T), e]
            error = 0.0
            for r in range(n):
                total = -w[row * per[1] + r]
                for c in range(m):
                    total += A[at_A + r * m + c] * t[row * m + c]
                total *= per_length if n == 6 and r >= 3 else 1.0
                error += total * total
            info[row * 3 + 2] = math.sqrt(error)
            good = info[row * 3 + 2] <= FEASIBILITY * W[_ASKED, e] + ROUNDING * W[_ROUNDING, e]
        status[row] = OPTIMAL if good else UNSURE


@_jit()
def _is_valid(A, w, lower, upper, ref, weights, length, n, m):
    """Whether the numbers of a row are a problem, as `TensionProblem` has it."""
    if not 1e-20 <= length <= 1e20:
        return False
    for i in range(n * m):
        if not abs(A[i]) < 1e50:
            return False
    for i in range(n):
        if not abs(w[i]) < 1e50:
            return False
    for c in range(m):
        if not (lower[c] <= 1e50 and upper[c] >= -1e50 and lower[c] <= upper[c]):
            return False
        if not (abs(ref[c]) < 1e50 and 1e-20 <= weights[c] <= 1e20):
            return False
    return True


@_jit(
    numba.void(
        *[_GIVEN] * 7,
        numba.types.Array(numba.int64, 1, "C", readonly=True),
        *[numba.int64] * 4,
        *[_VECTOR] * 3,
        numba.types.Array(numba.int8, 1, "C"),
    )
)
def solve_rows(A, w, lower, upper, ref, weights, length, per, n, m, start, stop, t, d, info, status):
    """Solve the rows start to stop of a batch.

    Parameters
    ----------
    A, w, lower, upper, ref, weights, length :
        As in `solve_packed`, all rows one after another. `weights` of one number stands for equal ones.
    per :
        Shape (7,): numbers per row of each of these, 0 where one row serves all.
    t, d, info, status :
        Get tensions (rows * m), directions (rows * n), support, shortfall and wrench error (rows * 3) and codes (rows).
    """
    equal = np.ones(m)
    work = np.empty(work_size(n, m))
    planar = 0 <= m - n <= 2
    if planar:
        W = np.empty((_FIXED + m * _PER_CABLE + n * (_PER_WRENCH + m), _LANES))
        W[:] = 1.0
        for first in range(start, stop, _LANES):
            count = min(_LANES, stop - first)
            _lanes(A, w, lower, upper, ref, weights, length, per, n, m, first, count, t, info, status, W)
    for row in range(start, stop):
        if planar and status[row] == OPTIMAL:
            continue
        at = row * per[0]
        given_A = A[at : at + n * m]
        at = row * per[1]
        given_w = w[at : at + n]
        at = row * per[2]
        given_low = lower[at : at + m]
        at = row * per[3]
        given_high = upper[at : at + m]
        at = row * per[4]
        given_ref = ref[at : at + m]
        at = row * per[5]
        omega = weights[at : at + m] if weights.shape[0] > 1 else equal
        scale = length[row * per[6]]
        own_t, own_d, own_info = t[row * m : row * m + m], d[row * n : row * n + n], info[row * 3 : row * 3 + 3]
        if _is_valid(given_A, given_w, given_low, given_high, given_ref, omega, scale, n, m):
            status[row] = _solve(
                given_A, given_w, given_low, given_high, given_ref, omega, scale, n, m, own_t, own_d, own_info, work
            )
        else:
            status[row] = INVALID
