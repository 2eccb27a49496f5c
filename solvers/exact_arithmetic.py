r"""The optimum where rounding decides between yes and no, in exact arithmetic.

With w on the boundary of the available wrench set the feasible tensions have no interior, and an error of 1e-16 in A or
w makes a method in floating point miss all, or take one corner of them for the best. `judge` comes here if no
certificate explains why its method has no optimum. All numbers of a problem are integers times powers of two, so

$$
\min_{t_{min} \le t \le t_{max}} \; (t - t_{ref})^T \Omega (t - t_{ref}) + \rho \, |S (A t - w)|^2
$$

is solved without any rounding, by an active-set method on the limits. It is strictly convex, so the method ends. rho is
so large that the wrench error left is rounding, unless the price of the wrench is: where an error of 1e-15 would change
the cost by a part in a million, w is known no better than that.
"""

from fractions import Fraction
from math import lcm

import numpy as np

from ..tolerances import FEASIBILITY
from .problem import Array, TensionProblem, accepted_error

# Relative error of the wrench at an optimum where the cost is proportional to the wrench: 1e-22, far below rounding.
# Where the cost is K times as sensitive the error is K times as large.
_ERROR = 2.0**-73


def exact_optimum(problem: TensionProblem, nearest: Array) -> Array:
    """Return the tensions of least cost inside their limits [N], shape (m,), whose wrench is w or the nearest to it.

    Begins at the tensions `nearest`, (m,) [N], of the projection of w. Exact but for the rounding of the result.
    """
    size = problem.weights @ (nearest - problem.t_ref) ** 2
    wrench = accepted_error(problem, nearest) / FEASIBILITY
    _, exponent = np.frexp(size / wrench / wrench / _ERROR if size > 0.0 and wrench > 0.0 else 1.0)
    rho = Fraction(2) ** int(exponent)

    M = [[Fraction(x) for x in row] for row in problem.scaled_A.tolist()]
    w = [Fraction(x) for x in problem.scaled_w.tolist()]
    weights = [Fraction(x) for x in problem.weights.tolist()]
    t_ref = [Fraction(x) for x in problem.t_ref.tolist()]
    columns = list(zip(*M, strict=True))
    H = [[rho * sum(a * b for a, b in zip(left, right, strict=True)) for right in columns] for left in columns]
    for i, weight in enumerate(weights):
        H[i][i] += weight
    slope = [
        rho * sum(a * b for a, b in zip(column, w, strict=True)) + weight * wish
        for column, weight, wish in zip(columns, weights, t_ref, strict=True)
    ]
    limits = list(zip(problem.t_min.tolist(), problem.t_max.tolist(), strict=True))
    optimum = minimum_in_box(H, slope, limits, [Fraction(x) for x in nearest.tolist()])
    t = np.array([float(x) for x in optimum])
    return np.minimum(np.maximum(t, problem.t_min), problem.t_max)


def minimum_in_box(
    H: list[list[Fraction]], slope: list[Fraction], limits: list[tuple[float, float]], x: list[Fraction]
) -> list[Fraction]:
    """Minimise x H x / 2 - slope x for low <= x <= high, from an x inside; H positive definite, limits may be infinite.

    What is free lies strictly between its limits, so each step lowers the cost and no set of free variables returns.
    """
    free = [i for i, (low, high) in enumerate(limits) if low < x[i] < high]
    while True:
        fixed = [i for i in range(len(x)) if i not in free]
        right = [slope[i] - sum(H[i][j] * x[j] for j in fixed) for i in free]
        target = dict(zip(free, _solved([[H[i][j] for j in free] for i in free], right), strict=True))
        step = Fraction(1)
        for i, end in target.items():
            limit = limits[i][end > x[i]]
            if (end > limit) if end > x[i] else (end < limit):
                step = min(step, (Fraction(limit) - x[i]) / (end - x[i]))
        for i, end in target.items():
            x[i] += step * (end - x[i])
        if step < 1:
            free = [i for i in free if x[i] not in limits[i]]
            continue
        # The cost falls fastest, for its curvature, along the one that is freed.
        gain = {}
        for i in fixed:
            down = slope[i] - sum(H[i][j] * x[j] for j in range(len(x)))
            low, high = limits[i]
            if (down > 0 and x[i] < high) or (down < 0 and x[i] > low):
                gain[i] = down * down / H[i][i]
        if not gain:
            return x
        free = sorted([*free, max(gain, key=lambda i: gain[i])])


def _solved(matrix: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """Solve a positive definite system by elimination on integers (Bareiss 1968): no fraction, no common divisors."""
    rows = []
    for row, value in zip(matrix, right, strict=True):
        together = [*row, value]
        denominator = lcm(*(each.denominator for each in together))
        rows.append([int(each * denominator) for each in together])
    size, before = len(rows), 1
    for k in range(size):
        for i in range(size):
            if i != k:
                rows[i] = [
                    (rows[k][k] * value - rows[i][k] * top) // before if j > k else 0
                    for j, (value, top) in enumerate(zip(rows[i], rows[k], strict=True))
                ]
        before = rows[k][k]
    return [Fraction(row[-1], before) for row in rows]
