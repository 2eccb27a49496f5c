r"""Bounded least norm in the null space of the wrench matrix, one problem at a time: behind "active-set".

$$
\min_s |s|^2 \quad \text{s.t.} \quad B s = b, \; lower \le s \le upper, \qquad s = s_0 + N z
$$

B is reduced by Householder reflections from the right with row pivoting (B = P^T L Q_1^T; Golub and Van Loan, 5.4).
That gives the least-norm s_0, orthogonal to the orthonormal null-space basis N; what remains is the z of least norm
inside slabs, one for each cable. A dual active-set method (Goldfarb and Idnani 1983) adds the most violated limit and
drops those whose multiplier would change sign.

Nothing here is believed that the data do not confirm. Tensions count only if, inside their limits, their wrench error
is below `TensionProblem.tolerance` and the multipliers of the limits prove that they are optimal; a direction only if
its support value falls short of the demand by more than the tolerance. Near the boundary, near the rank cut, or where
rounding leads the iteration astray, the answer is UNSURE and another method answers: see `solve`.
"""

from __future__ import annotations

import math

from ...tolerances import FEASIBILITY, ROUNDING
from .codes import INFEASIBLE, OPTIMAL, SINGULAR, SLACK, UNSURE
from .dual_active_set import dual_active_set
from .jit import GIVEN, VECTOR, compilable
from .memory import floats, integers
from .proof import proves
from .reduction import reduce, reflect

__all__ = ["solve_one", "solve_packed", "what_counts", "work_size"]


@compilable()
def work_size(n: int, m: int) -> int:
    """Return how many numbers of scratch one problem needs."""
    return n * m + 6 * n + 5 * m + m * m + (2 * m * m + 5 * m + 1)


@compilable()
def what_counts(A, w, lower, upper, ref, t, length, n, m):
    """Return what the problem requires, the sum of the terms that are rounded, and the largest norm of a column.

    See `TensionProblem.tolerance`.
    """
    per_length = 1.0 / length
    required, rounding, largest = 0.0, 0.0, 0.0
    for i in range(n):
        x = w[i] * (per_length if n == 6 and i >= 3 else 1.0)
        required += x * x
    required = math.sqrt(required)
    for c in range(m):
        square = 0.0
        for i in range(n):
            x = A[i * m + c] * (per_length if n == 6 and i >= 3 else 1.0)
            square += x * x
        norm = math.sqrt(square)
        largest = max(largest, norm)
        required += norm * abs(min(max(lower[c], 0.0), upper[c]))
        rounding += norm * (abs(t[c]) + abs(ref[c]))
    return required, rounding, largest


# One signature, so that Numba does not compile it once more for arrays that may be written.
@compilable("int64", *[GIVEN] * 6, "float64", "int64", "int64", *[VECTOR] * 4)
def solve_one(A, w, lower, upper, ref, weights, length, n, m, t, d, info, work):
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
    N = work[at : at + m * m]
    at += m * m
    rest = work[at:]
    counts = integers(n + 2 * m)
    order, moving, active = counts[:n], counts[n : n + m], counts[n + m :]

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
    for i in range(n):
        scale = per_length if n == 6 and i >= 3 else 1.0
        total = w[i]
        for c in range(m):
            total -= A[i * m + c] * t[c]
        b[i] = total * scale
        for c in range(mm):
            B[i * mm + c] = A[i * m + moving[c]] * scale * unit[c]

    rank = reduce(B, n, mm, order, diag, tau, norms)
    if rank < 0:
        return UNSURE
    square = 0.0
    for j in range(rank):
        x = b[order[j]]
        for i in range(j):
            x -= B[j * mm + i] * y[i]
        y[j] = x / diag[j]
        square += y[j] * y[j]
        s[j] = y[j]
    slack = SLACK * max(size, math.sqrt(square))
    missing, worst, side = 0.0, -1, 0.0  # the part of w that is farthest outside the range of A
    for j in range(rank, n):
        x = b[order[j]]
        for i in range(rank):
            x -= B[j * mm + i] * y[i]
        if abs(x) > missing:
            missing, worst, side = abs(x), j, math.copysign(1.0, x)
    for c in range(rank, mm):
        s[c] = 0.0
    for j in range(rank - 1, -1, -1):
        reflect(B, tau, j, mm, s, 0)

    outside = False
    for c in range(mm):
        push[c] = 0.0
        if s[c] < low[c] - slack or s[c] > high[c] + slack:
            outside = True
    outcome = 0
    k = mm - rank
    if outside:
        for c in range(k * mm):
            N[c] = 0.0
        for c in range(k):
            N[c * mm + rank + c] = 1.0
            for j in range(rank - 1, -1, -1):
                reflect(B, tau, j, mm, N, c * mm)
        outcome = dual_active_set(N, k, s, low, high, mm, slack, push, rest, active)
    for c in range(mm):
        t[moving[c]] += unit[c] * s[c]
    for c in range(m):
        t[c] = min(max(t[c], lower[c]), upper[c])
    needed, rounding, largest = what_counts(A, w, lower, upper, ref, t, length, n, m)
    if outcome == 0:
        error = 0.0
        for i in range(n):
            total = -w[i]
            for c in range(m):
                total += A[i * m + c] * t[c]
            if n == 6 and i >= 3:
                total *= per_length
            error += total * total
        info[2] = math.sqrt(error)
        if info[2] <= FEASIBILITY * needed + ROUNDING * rounding:
            return OPTIMAL
    # A part of w outside the range of A makes the problem singular, whatever else is wrong with it.
    singular = missing > 1e-10 * needed
    if outcome == 2 or (outcome == 0 and not singular):
        return UNSURE
    # B^T d = push, which is in the row space of B; or 0 with d[worst] = side.
    if singular:
        for j in range(rank):
            push[j] = -side * B[worst * mm + j]
    else:
        for j in range(rank):
            reflect(B, tau, j, mm, push, 0)
    for j in range(rank - 1, -1, -1):
        x = push[j]
        for i in range(j + 1, rank):
            x -= B[i * mm + j] * y[i]
        y[j] = x / diag[j]
    for i in range(n):
        d[order[i]] = y[i] if i < rank else 0.0
    if singular:
        d[order[worst]] = side
    verdict = proves(A, w, lower, upper, n, m, per_length, needed, rounding, largest, d, info)
    return verdict if verdict == (SINGULAR if singular else INFEASIBLE) else UNSURE


@compilable("int64", GIVEN, "int64", "int64", VECTOR)
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
    work = floats(work_size(n, m) + n + 3)
    return solve_one(
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
