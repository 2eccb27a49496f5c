r"""The optimum where rounding decides between yes and no, in exact arithmetic.

With w on the boundary of the available wrench set the feasible tensions have no interior, and an error of 1e-16 in A or
w makes a method in floating point miss all, or take one corner of them for the best. `verify` comes here if no
certificate explains why its method has no optimum. All numbers of a problem are integers times powers of two, so

$$
\min_{t_{min} \le t \le t_{max}} \; (t - t_{ref})^T \Omega (t - t_{ref}) + \rho \, |S (A t - w)|^2
$$

is solved without any rounding, by an active-set method on the limits. It is strictly convex, so the method ends. rho is
so large that the wrench error left is rounding, unless the price of the wrench is: where an error of 1e-15 would change
the cost by a part in a million, w is known no better than that.
"""

from collections.abc import Sequence
from fractions import Fraction
from math import lcm

import numpy as np

from ..base.tolerances import FEASIBILITY
from .box_least_squares import Projection
from .problem import Array, TensionProblem, accepted_error

# Relative error of the wrench at an optimum where the cost is proportional to the wrench: 1e-22, far below rounding.
# Where the cost is K times as sensitive the error is K times as large.
_ERROR = 2.0**-73


def exact_optimum(problem: TensionProblem, nearest: Array) -> Projection:
    """Find the tensions of least cost inside their limits whose wrench is w, or the nearest to it.

    The residual is that of the tensions before they are rounded. Where the wrench is not the nearest, rho is raised
    until its error falls no more.

    - `problem`: the problem.
    - `nearest`: tensions of the projection of w [N], (m,), to start from.
    """
    size = problem.weights @ (nearest - problem.t_ref) ** 2
    wrench = accepted_error(problem, nearest) / FEASIBILITY
    _, exponent = np.frexp(size / wrench / wrench / _ERROR if size > 0.0 and wrench > 0.0 else 1.0)
    rho = Fraction(2) ** int(exponent)

    entries, unit = _integers(problem.scaled_A.ravel().tolist())
    given, wrench_unit = _integers(problem.scaled_w.tolist())
    rows = [entries[i * problem.m : (i + 1) * problem.m] for i in range(problem.n)]
    columns = [entries[c :: problem.m] for c in range(problem.m)]
    squares = [[Fraction(_dot(left, right), unit * unit) for right in columns] for left in columns]
    along = [Fraction(_dot(column, given), unit * wrench_unit) for column in columns]
    weights = [Fraction(x) for x in problem.weights.tolist()]
    t_ref = [Fraction(x) for x in problem.t_ref.tolist()]
    limits = list(zip(problem.t_min.tolist(), problem.t_max.tolist(), strict=True))
    x, before = [Fraction(value) for value in nearest.tolist()], np.inf
    while True:
        H = [[rho * value for value in row] for row in squares]
        for i, weight in enumerate(weights):
            H[i][i] += weight
        slope = [rho * a + weight * wish for a, weight, wish in zip(along, weights, t_ref, strict=True)]
        x = minimum_in_box(H, slope, limits, x)
        t = np.minimum(np.maximum([float(value) for value in x], problem.t_min), problem.t_max)
        together = lcm(*(value.denominator for value in x))
        parts = [value.numerator * (together // value.denominator) * wrench_unit for value in x]
        left = [b * unit * together - _dot(row, parts) for row, b in zip(rows, given, strict=True)]
        missing = np.array([value / (unit * wrench_unit * together) for value in left])
        error = float(np.linalg.norm(missing))
        if error <= accepted_error(problem, t) or error > 0.5 * before:
            return Projection(t, missing)
        rho, before = rho / Fraction(_ERROR) ** 4, error


def _integers(values: list[float]) -> tuple[list[int], int]:
    """Return numbers as integers over one power of two."""
    ratios = [value.as_integer_ratio() for value in values]
    unit = max(denominator for _, denominator in ratios)
    return [numerator * (unit // denominator) for numerator, denominator in ratios], unit


def _dot(x: Sequence[int], y: Sequence[int]) -> int:
    return sum(a * b for a, b in zip(x, y, strict=True))


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
