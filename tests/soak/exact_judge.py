"""Judge statuses, tensions and certificates in integers: nothing is rounded, and nothing is neglected.

A wrong answer cannot hide behind a tolerance that it shares with the judge: a certificate has to exclude the wrench
exactly, and tensions have to be inside the limits and to give the wrench within `TensionProblem.tolerance`, stated here
a second time. Floating point proposes multipliers; what they prove is computed with integers.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .exact_problems import ExactProblem

__all__ = ["DOUBLE", "FLOAT", "Judge", "Tolerances"]

Array = NDArray[np.float64]
Integers = list[int]

STEPS = 200  # of the search for the least cost


class Tolerances(NamedTuple):
    """The documented numbers.

    Attributes:
        required, terms: Wrench error that is accepted, relative to what is required and to the terms of A t.
        cancelled: Terms of A t count up to this many times what is required.
        gap: What the tensions may cost beyond the least, relative.
        negligible: Pulls below this part of a column's norm are called zero by the status "singular".
        distance: Distance from the optimum, relative to the largest tension; float alone states one. The cost of float
            is the square of a norm that may be off by as much, so that its gap may be twice that.
    """

    required: float
    terms: float
    cancelled: float
    gap: float
    negligible: float
    distance: float


DOUBLE = Tolerances(1e-9, 1e-13, 1e10, 1e-8, 1e-11, np.inf)
FLOAT = Tolerances(1e-5, 2e-6, 5e2, (1.0 + 1e-4) ** 2 - 1.0, 4e-6, 1e-4)
ROUNDED = 1.0 + 1e-9  # of a tolerance: it is computed with rounding


class Judge:
    """An exact problem, made ready to judge answers to it; rows of moments are divided by the length."""

    def __init__(self, problem: ExactProblem, tolerances: Tolerances):
        self.problem = problem
        self.tolerances = tolerances
        n = len(problem.w)
        scale = np.ones(n)
        if n == 6:
            scale[3:] = 1.0 / problem.length  # a power of two
        self.scale = scale
        self.SA, self.Sw = problem.A * scale[:, None], problem.w * scale
        self.A, self.unit = _integers(self.SA.ravel().tolist())
        self.w, self.wrench_unit = _integers(self.Sw.tolist())
        m = problem.A.shape[1]
        self.columns = [self.A[c::m] for c in range(m)]
        self.norms = np.array([_norm(column) / self.unit for column in self.columns])

    def excludes(self, direction: Array) -> bool:
        """Return whether w lies exactly beyond all that tensions can give along a direction, or along one next to it.

        A direction in floating point is not quite orthogonal to a cable without a limit. The exact one next to it is
        found by taking the part along such cables away.
        """
        if not np.isfinite(direction).all() or not direction.any():
            return False
        given, _ = _integers((direction / self.scale).tolist())
        d, low, high = given, self.problem.t_min.tolist(), self.problem.t_max.tolist()
        basis: list[Integers] = []
        for _ in range(len(given) + 1):
            pulls = [_dot(d, column) for column in self.columns]
            endless = [c for c, pull in enumerate(pulls) if pull and abs(high[c] if pull > 0 else low[c]) == np.inf]
            if not endless:
                break
            basis.append(_orthogonal(self.columns[endless[0]], basis))
            d = _orthogonal(given, basis)
        else:
            return False
        # d . w > sum of pull . limit, all over their units.
        beyond = Fraction(_dot(d, self.w), self.wrench_unit)
        for pull, least, most in zip(pulls, low, high, strict=True):
            if pull:
                beyond -= Fraction(pull, self.unit) * Fraction(most if pull > 0 else least)
        return beyond > 0

    def is_nearly_orthogonal(self, direction: Array) -> bool:
        """Return whether no cable pulls along a direction by more than `negligible` of its column norm."""
        d, _ = _integers((direction / self.scale).tolist())
        size = _norm(d)
        return all(
            abs(_dot(d, column)) <= ROUNDED * self.tolerances.negligible * _norm(column) * size
            for column in self.columns
        )

    def largest(self) -> float:
        """Return the largest wrench of a cable at a limit, or at its t_ref [N]."""
        loads = np.abs([self.problem.t_min, self.problem.t_max, self.problem.t_ref])
        return float(self.norms.max() * loads[np.isfinite(loads)].max(initial=0.0))

    def condition(self) -> float:
        """Return the condition of the matrix, its columns divided by the roots of the weights, within its range."""
        sigma = np.linalg.svd(self.SA / np.sqrt(self.problem.weights), compute_uv=False)
        return float(sigma[0] / sigma[sigma > 1e-12 * sigma[0]][-1]) if sigma[0] > 0.0 else 1.0

    def off_range(self) -> float:
        """Return by how much all tensions, of any sign and size, miss w [N]: zero only if some give it."""
        basis: list[Integers] = []
        for column in self.columns:
            rest = _orthogonal(column, basis)
            if any(rest):
                basis.append(rest)
        rest = _orthogonal(self.w, basis)
        if not any(rest):
            return 0.0
        return float(Fraction(_dot(rest, self.w) ** 2, _dot(rest, rest) * self.wrench_unit**2)) ** 0.5

    def tolerance(self, tensions: Array) -> float:
        """Return the documented wrench error [N] at which tensions are accepted."""
        nearest = np.minimum(np.maximum(self.problem.t_min, 0.0), self.problem.t_max)
        required = float(np.linalg.norm(self.Sw) + self.norms @ np.abs(nearest))
        reference = float(self.norms @ np.abs(self.problem.t_ref))
        terms = min(float(self.norms @ np.abs(tensions)), self.tolerances.cancelled * required + reference)
        return ROUNDED * (self.tolerances.required * required + self.tolerances.terms * (terms + reference))

    def error(self, tensions: Array) -> float:
        """Return |S (A t - w)| [N], rounded once; inf if a tension is beyond a limit."""
        if not ((tensions >= self.problem.t_min) & (tensions <= self.problem.t_max)).all():
            return np.inf
        t, load_unit = _integers(tensions.tolist())
        m = len(t)
        common = self.wrench_unit * self.unit * load_unit
        errors = [
            Fraction(_dot(self.A[i * m : i * m + m], t) * self.wrench_unit - w * self.unit * load_unit, common)
            for i, w in enumerate(self.w)
        ]
        return float(np.linalg.norm([float(x) for x in errors]))

    def gap(self, tensions: Array, multipliers: Array) -> float:
        """Return by how much tensions cost more than the least for their own wrench, at most, relative to their cost.

        Multipliers y of any origin prove it: inside the limits sum omega (t - t_ref)^2 - 2 y . S A t is nowhere less
        than the sum of its least values for each cable. Rounding of the tensions by 1e-13 is no gap.
        """
        p = self.problem
        y, unit = _integers(multipliers.tolist())
        unit *= self.unit
        omega, weight_unit = _integers(p.weights.tolist())
        low, high = p.t_min.tolist(), p.t_max.tolist()
        limits = [x for x in (*low, *high) if abs(x) < np.inf]
        numbers, load_unit = _integers([*tensions.tolist(), *p.t_ref.tolist(), *limits])
        known = dict(zip(limits, numbers[2 * len(omega) :], strict=True))
        total = cost = terms = 0.0
        for c, column in enumerate(self.columns):
            x, wish, weight, slope = numbers[c], numbers[len(omega) + c], omega[c], _dot(y, column)
            # Over the units of all: half of the slope of the cost, less y . a, at x and at the limits.
            left, right = weight * unit, slope * weight_unit * load_unit
            common = unit * weight_unit * load_unit
            least, most = known.get(low[c]), known.get(high[c])
            limit = None
            if least is not None and left * (least - wish) > right:
                limit = least
            elif most is not None and left * (most - wish) < right:
                limit = most
            if limit is None:
                total += ((left * (x - wish) - right) / common) ** 2 / p.weights[c]
            else:
                total += (x - limit) / load_unit * ((left * (x + limit - 2 * wish) - 2 * right) / common)
            cost += p.weights[c] * ((x - wish) / load_unit) ** 2
            terms += p.weights[c] * (float(tensions[c]) ** 2 + float(p.t_ref[c]) ** 2)
        return total / (cost + 1e-18 * terms) if total else 0.0

    def smallest_gap(self, tensions: Array) -> float:
        """Return the gap that the best multipliers prove: those drawn, or fitted to the gradient of the cost."""
        drawn, gap = self.problem.multipliers, np.inf
        for multipliers in (drawn, self._fitted(tensions)):
            if multipliers is not None and not gap <= self.tolerances.gap:
                gap = min(gap, self.gap(tensions, multipliers))
        return gap if gap <= self.tolerances.gap else self._exact_gap(tensions)

    def distance_to_optimum(self, tensions: Array) -> str:
        """Return how tensions miss the optimum by more than they may, if its multipliers were drawn, else nothing."""
        p = self.problem
        if p.multipliers is None:
            return ""
        best = np.minimum(np.maximum(p.t_ref + self.SA.T @ p.multipliers / p.weights, p.t_min), p.t_max)
        off = float(np.abs(tensions - best).max())
        allowed = self.tolerances.distance * float(np.abs(best).max() + np.abs(p.t_ref).max())
        return "" if off <= allowed else f"the optimum is {off:g} N away"

    def _exact_gap(self, tensions: Array) -> float:
        """Return the gap to the least cost of the tensions' own wrench, which a primal active-set method finds."""
        p, m = self.problem, len(self.columns)
        omega, wish, x = ([Fraction(value) for value in array.tolist()] for array in (p.weights, p.t_ref, tensions))
        low, high = p.t_min.tolist(), p.t_max.tolist()
        t, free = x[:], [c for c in range(m) if low[c] < x[c] < high[c]]
        for _ in range(STEPS):
            # Of least cost with the same wrench: omega_c (x_c - wish_c) = y . a_c for the free ones.
            y = self._multipliers(free, omega, [x[c] - wish[c] for c in free])
            slope = [sum((a * b for a, b in zip(column, y, strict=True) if b), Fraction(0)) for column in self.columns]
            step, stop = Fraction(1), -1
            for c in free:
                end = wish[c] + slope[c] / omega[c]
                limit = high[c] if end > x[c] else low[c]
                if (end > limit) if end > x[c] else (end < limit):
                    part = (Fraction(limit) - x[c]) / (end - x[c])
                    if part < step or stop < 0:
                        step, stop = part, c
            for c in free:
                x[c] += step * (wish[c] + slope[c] / omega[c] - x[c])
            if stop >= 0:
                free.remove(stop)
                continue
            for c in range(m):
                down = slope[c] - omega[c] * (x[c] - wish[c])
                if c not in free and ((down > 0 and x[c] < high[c]) or (down < 0 and x[c] > low[c])):
                    free = sorted([*free, c])
                    break
            else:
                break
        else:
            return np.inf
        cost, least = (sum(o * (v - r) ** 2 for o, v, r in zip(omega, values, wish, strict=True)) for values in (t, x))
        # The least cost is a convex function of the wrench, of slope 2 y: for a wrench within the tolerance it is more.
        price = 2.0 * self.unit * float(np.linalg.norm([float(a) for a in y])) * self.tolerance(tensions)
        over = cost - least - Fraction(price)
        allowed = cost + sum(o * (v * v + r * r) for o, v, r in zip(omega, t, wish, strict=True)) / 10**18
        return float(over / allowed) if over > 0 else 0.0

    def _multipliers(self, free: list[int], omega: list[Fraction], off: list[Fraction]) -> list[Fraction]:
        """Return y, such that off + change, of gradient A^T y, has the least cost of all changes with A change = 0."""
        m, rows, basis = len(self.columns), [], list[Integers]()
        for i in range(len(self.w)):
            row = [self.A[i * m + c] for c in free]
            rest = _orthogonal(row, basis)
            if any(rest):
                basis.append(rest)
                rows.append(i)
        u = [[self.A[i * m + c] for c in free] for i in rows]
        square = [
            [sum((Fraction(a * b) / omega[c] for a, b, c in zip(x, y, free, strict=True)), Fraction(0)) for y in u]
            for x in u
        ]
        shares = _solved(square, [sum((a * b for a, b in zip(x, off, strict=True)), Fraction(0)) for x in u])
        y = [Fraction(0)] * len(self.w)
        for i, share in zip(rows, shares, strict=True):
            y[i] = share
        return y

    def _fitted(self, tensions: Array) -> Array:
        """Return the multipliers y, with s = (S A Omega^-1/2)^T y + mu nearest to the gradient."""
        from scipy.optimize import nnls

        p = self.problem
        root = np.sqrt(p.weights)
        s = root * (tensions - p.t_ref)
        size = float(np.abs(s).max())
        if size == 0.0:
            return np.zeros(len(p.w))
        near = 1e-9 * root * np.maximum(np.abs(tensions), np.abs(p.t_ref))
        low, high = root * (tensions - p.t_min) <= near, root * (p.t_max - tensions) <= near
        rows = self.SA / root
        heights = np.linalg.norm(rows, axis=1)
        rows = (rows / np.where(heights > 0.0, heights, 1.0)[:, None]).T
        identity = np.eye(len(s))
        columns = np.hstack([rows, -rows, identity[:, low], -identity[:, high]])
        fit = nnls(columns, s / size)[0] * size
        n = len(p.w)
        return np.where(heights > 0.0, (fit[:n] - fit[n : 2 * n]) / np.where(heights > 0.0, heights, 1.0), 0.0)


def _integers(values: list[float]) -> tuple[Integers, int]:
    """Return finite numbers as integers over one power of two."""
    ratios = [value.as_integer_ratio() for value in values]
    unit = max(denominator for _, denominator in ratios)
    return [numerator * (unit // denominator) for numerator, denominator in ratios], unit


def _dot(x: Integers, y: Integers) -> int:
    return sum(a * b for a, b in zip(x, y, strict=True))


def _solved(matrix: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """Solve a positive definite system by elimination."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for k, top in enumerate(rows):
        for row in rows[k + 1 :]:
            factor = row[k] / top[k]
            if factor:
                row[k:] = [a - factor * b for a, b in zip(row[k:], top[k:], strict=True)]
    x: list[Fraction] = []
    for k in range(len(rows) - 1, -1, -1):
        known = sum((a * b for a, b in zip(rows[k][k + 1 : -1], x, strict=True)), Fraction(0))
        x.insert(0, (rows[k][-1] - known) / rows[k][k])
    return x


def _norm(x: Integers) -> float:
    """Return the length of integers, also of those beyond the range of floats."""
    most = max(abs(a) for a in x)
    shift = max(0, most.bit_length() - 500)
    return float(np.sqrt(float(sum((a >> shift) ** 2 for a in x)))) * 2.0**shift


def _orthogonal(x: Integers, basis: list[Integers]) -> Integers:
    """Return x less its parts along a basis of orthogonal integers, times a positive factor."""
    for other in basis:
        square, along = _dot(other, other), _dot(x, other)
        if along:
            x = [square * a - along * b for a, b in zip(x, other, strict=True)]
    return x
