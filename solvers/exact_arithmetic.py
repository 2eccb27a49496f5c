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
from math import gcd, isfinite
from operator import mul

import numpy as np

from ..base.tolerances import FEASIBILITY
from .box_least_squares import Projection
from .problem import Array, TensionProblem, accepted_error

# Relative error of the wrench at an optimum where the cost is proportional to the wrench: 1e-22, far below rounding.
# If the cost is K times as sensitive, the error is K times as large.
_ERROR = 2.0**-73


def exact_optimum(problem: TensionProblem, nearest: Array) -> Projection:
    """Find the tensions of least cost inside their limits whose wrench is w, or the nearest to it.

    The residual refers to the tensions before they are rounded. Where the wrench is not the nearest, rho is raised
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
    weights, weight_unit = _integers(problem.weights.tolist())
    ends = [*problem.t_min.tolist(), *problem.t_max.tolist()]
    finite = [value for value in ends if isfinite(value)]
    tensions, tension_unit = _integers([*problem.t_ref.tolist(), *nearest.tolist(), *finite])
    scale = max(tension_unit // wrench_unit, 1)
    newton = scale * wrench_unit  # of tensions as integers
    tensions = [value * (newton // tension_unit) for value in tensions]
    wishes, x = tensions[: problem.m], tensions[problem.m : 2 * problem.m]
    known = dict(zip(finite, tensions[2 * problem.m :], strict=True))
    limits = [(known.get(low), known.get(high)) for low, high in zip(ends[: problem.m], ends[problem.m :], strict=True)]
    rows = [entries[i * problem.m : (i + 1) * problem.m] for i in range(problem.n)]
    columns = [entries[c :: problem.m] for c in range(problem.m)]
    squares = [[_dot(left, right) * weight_unit for right in columns] for left in columns]
    along = [_dot(column, given) * weight_unit * unit * scale for column in columns]
    divisor, before = 1, np.inf
    while True:
        H = [[rho.numerator * value for value in row] for row in squares]
        slope = [rho.numerator * value for value in along]
        for i, (weight, wish) in enumerate(zip(weights, wishes, strict=True)):
            own = rho.denominator * weight * unit * unit
            H[i][i] += own
            slope[i] += own * wish
        common = gcd(*slope, *(value for row in H for value in row))
        H = [[value // common for value in row] for row in H]
        x, divisor = minimum_in_box(H, [value // common for value in slope], limits, x, divisor)
        t = np.minimum(np.maximum([value / (divisor * newton) for value in x], problem.t_min), problem.t_max)
        left = [b * unit * scale * divisor - _dot(row, x) for row, b in zip(rows, given, strict=True)]
        missing = np.array([value / (unit * newton * divisor) for value in left])
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
    return sum(map(mul, x, y))


def minimum_in_box(
    H: list[list[int]], slope: list[int], limits: list[tuple[int | None, int | None]], x: list[int], divisor: int
) -> tuple[list[int], int]:
    """Minimise y H y / 2 - slope y for low <= y <= high, from y = x / divisor inside; return another x and divisor.

    H is positive definite; a limit that is None is infinite. What is free lies strictly between its limits, so each
    step lowers the cost and no set of free variables returns.
    """

    def at(i: int, upper: bool) -> bool:
        """Return whether x is at its lower or upper limit."""
        limit = limits[i][upper]
        return limit is not None and x[i] == limit * divisor

    free = [i for i in range(len(x)) if not (at(i, False) or at(i, True))]
    while True:
        fixed = {i: x[i] // divisor for i in range(len(x)) if i not in free}  # at their limits
        right = [slope[i] - sum(H[i][j] * limit for j, limit in fixed.items()) for i in free]
        ends, below = _solved([[H[i][j] for j in free] for i in free], right)
        # The part of the step up to the first limit, as a numerator and a denominator.
        part, whole, stopped = 1, 1, False
        for i, end in zip(free, ends, strict=True):
            change = end * divisor - x[i] * below
            limit = limits[i][change > 0]
            if limit is not None and (end > limit * below if change > 0 else end < limit * below):
                until = (limit * divisor - x[i]) * below
                if abs(until) * whole < part * abs(change):
                    part, whole, stopped = abs(until), abs(change), True
        x = [value * below * whole for value in x]
        for i, end in zip(free, ends, strict=True):
            x[i] += part * (end * divisor - x[i] // whole)
        divisor *= below * whole
        common = gcd(divisor, *x)
        x, divisor = [value // common for value in x], divisor // common
        if stopped:
            free = [i for i in free if not (at(i, False) or at(i, True))]
            continue
        # The cost falls fastest, for its curvature, along the one that is freed.
        gain = {}
        for i in fixed:
            down = slope[i] * divisor - _dot(H[i], x)
            if down and not at(i, down > 0):
                gain[i] = down * down // H[i][i]
        if not gain:
            return x, divisor
        free = sorted([*free, max(gain, key=lambda i: gain[i])])


def _solved(matrix: list[list[int]], right: list[int]) -> tuple[list[int], int]:
    """Solve a positive definite system by elimination on integers (Bareiss 1968); return x and what divides all of it.

    After each step the remaining matrix is symmetric, so only its upper triangle is stored.
    """
    size, before = len(right), 1
    rows = [[*row[i:], value] for i, (row, value) in enumerate(zip(matrix, right, strict=True))]
    for k, top in enumerate(rows):
        for i in range(k + 1, size):
            factor = top[i - k]
            rows[i] = [
                (top[0] * value - factor * above) // before for value, above in zip(rows[i], top[i - k :], strict=True)
            ]
        before = top[0]
    x: list[int] = []
    for row in reversed(rows):
        x.insert(0, (before * row[-1] - _dot(row[1:-1], x)) // row[0])
    return x, before
