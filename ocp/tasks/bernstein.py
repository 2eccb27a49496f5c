"""Polynomials by their Bernstein points: exact integrals, and bounds that hold between the nodes.

Over an interval of h seconds a polynomial of degree d is sum_i p_i B_i(s), B_i(s) = C(d, i) s^i (1 - s)^(d - i), with
s from 0 to 1. It starts at p_0, ends at p_d and lies inside the convex hull of all its points: a convex limit that
holds at those holds at every time. The points of its integral from f are

    f,  f + h/(d + 1) p_0,  f + h/(d + 1) (p_0 + p_1),  ...,

so of an acceleration that is a polynomial, speed and position are known exactly.

Points are NumPy arrays or CasADi expressions.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import comb
from typing import Any, TypeAlias

import numpy as np

Values: TypeAlias = Any  # np.ndarray or a CasADi expression


def basis(degree: int, shares: np.ndarray | Sequence[float]) -> np.ndarray:
    """Return B_i at each share of an interval, (k, degree + 1)."""
    s = np.asarray(shares, dtype=float)[:, None]
    i = np.arange(degree + 1)
    return np.array([comb(degree, j) for j in i]) * s**i * (1 - s) ** (degree - i)


def integral(h: Values, start: Values, points: Sequence[Values]) -> list[Values]:
    """Return the points of the integral that begins at `start`."""
    integrated = [start]
    for point in points:
        integrated.append(integrated[-1] + h / len(points) * point)
    return integrated


def derivative(h: Values, points: Sequence[Values]) -> list[Values]:
    """Return the points of the time derivative."""
    degree = len(points) - 1
    return [degree / h * (after - before) for before, after in pairwise(points)]


def value(points: Sequence[Values], share: float) -> Values:
    """Return the value of the polynomial at one share of the interval."""
    return sum(float(b) * point for b, point in zip(basis(len(points) - 1, [share])[0], points, strict=True) if b != 0)


def joined(h: Values, points: Sequence[Values], speed: Values, end: Values, end_speed: Values) -> list[Values]:
    """Return the points of a position whose last two follow from its end, not from integration over the whole interval.

    On a motion they are the same; in a program they depend on fewer unknowns, and the limits at both sides of a node
    are the same ones.
    """
    degree = len(points) - 1
    if degree < 3:
        return [*points[:-1], end]
    return [points[0], points[0] + h / degree * speed, *points[2:-2], end - h / degree * end_speed, end]


def mean_square(points: Sequence[Values], square: Any) -> Values:
    """Return the mean over the interval of a polynomial's square; `square(a, b)` is the product of two points."""
    n = len(points) - 1
    total: Values = 0.0
    for i, a in enumerate(points):
        for j, b in enumerate(points):
            total = total + comb(n, i) * comb(n, j) / ((2 * n + 1) * comb(2 * n, i + j)) * square(a, b)
    return total
