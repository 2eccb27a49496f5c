"""Random tension problems in exact arithmetic: it is known whether the limits permit the wrench.

All numbers are integers times powers of two, computed as integers. A wrench that the cables can give is A t, with
tensions t inside the limits. One that they cannot give lies beyond a face of the available wrench set along the normal
of that face, and the distance is known. Of an optimum the multipliers are drawn first. No tolerance plays a part.
"""

from __future__ import annotations

from math import ldexp
from random import Random
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["ExactProblem", "exact_problem"]

Array = NDArray[np.float64]
Matrix = list[list[int]]

DIGITS = {"double": 53, "float": 24}  # of a number, binary ones
SCALES = {"double": 30, "float": 5}  # of rows, columns and loads, and
WEIGHTS = {"double": 20, "float": 8}  # of weights: powers of two to either side
NEAR = 23  # parallel cables are 2^-23 apart
TRIES = 60


class ExactProblem(NamedTuple):
    """A problem, and what is known of it.

    Attributes:
        A, w, t_min, t_max, t_ref, weights, length: As in `TensionProblem`, without any rounding.
        multipliers: Of the wrench, one for each row of S A t = S w, if they were drawn; then the optimum is known.
        outside: The distance from w to the available wrench set [N], moments divided by the length; 0 if the cables can
            give w.
        place: Where w is: "inside", "face", "corner", "outside", or "off range", where no tensions of either sign give
            it.
        rough: Whether scales differ, or cables are nearly parallel, such that rounding may decide.
    """

    A: Array  # (n, m)
    w: Array  # (n,)
    t_min: Array  # (m,)
    t_max: Array  # (m,)
    t_ref: Array  # (m,)
    weights: Array  # (m,)
    length: float
    multipliers: Array | None  # (n,)
    outside: float
    place: str
    rough: bool


class _Cables(NamedTuple):
    """A matrix of integers, with the power of two of each column and of each cable's tensions."""

    A: Matrix
    columns: list[int]
    loads: list[int]
    rough: bool


class _Limits(NamedTuple):
    """Limits, None if infinite, and tensions inside, in units of each cable's power of two."""

    low: list[int | None]
    high: list[int | None]
    t: list[int]


def exact_problem(seed: int, precision: str = "double") -> ExactProblem:
    """Return the problem of a seed, with 1 to 6 equations and 1 to 12 cables, in numbers of a precision."""
    rng = Random(seed)
    n = rng.randint(1, 6)
    m = rng.choice((rng.randint(1, 12), rng.randint(n, n + 2)))
    for attempt in range(TRIES):
        problem = _problem(rng, n, m, precision, plain=attempt > TRIES // 2)
        if problem is not None:
            return problem
    raise AssertionError(f"no problem of seed {seed} fits into numbers of precision {precision}")


def _problem(rng: Random, n: int, m: int, precision: str, plain: bool) -> ExactProblem | None:
    """Draw a problem, or return None if a number does not fit; a `plain` one has a single scale."""
    cables = _cables(rng, n, m, plain)
    place = rng.choices(("inside", "face", "corner", "outside", "off range"), (30, 15, 15, 30, 10))[0]
    normal = None if place == "inside" else _normal(rng, n)
    unlimited = rng.random() < 0.3
    for c in range(m):
        # Cables without a limit do not pull along the normal of a face.
        if normal and (place == "off range" or rng.random() < (0.4 if unlimited else 0.1)):
            _turn(cables.A, c, normal)
    limits = _limits(rng, cables, normal, place, unlimited)

    most, digits = SCALES[precision], DIGITS[precision]
    rows, rough = _powers(rng, n, 0 if plain else most)
    widths, uneven = _powers(rng, m, 0 if plain else most)
    columns = [a + b for a, b in zip(cables.columns, widths, strict=True)]
    loads = [a - b for a, b in zip(cables.loads, widths, strict=True)]
    kind = rng.random()
    if kind < 0.25 and not plain:  # the pull of the largest tension then differs from cable to cable
        loads = cables.loads
    load, unit, longer = (0, 0, 0) if rng.random() < 0.4 else (rng.randint(-most, most) for _ in range(3))
    longer = longer if n == 6 else 0
    rows, loads = [r + unit for r in rows], [x + load for x in loads]

    # Below, all is an integer times a power of two, the least one in a sum; moments are divided by the length.
    least = min(rows) + min(a + b for a, b in zip(columns, loads, strict=True))
    wrench = [
        sum(
            a * t << rows[i] + columns[c] + loads[c] - least for c, (a, t) in enumerate(zip(row, limits.t, strict=True))
        )
        for i, row in enumerate(cables.A)
    ]
    outside = 0.0
    if place in ("outside", "off range") and normal:
        away = [d << max(rows) - r for d, r in zip(normal, rows, strict=True)]
        size = max(abs(x) for x in wrench) or 1 << max(0, -least)
        # The distance is from a millionth of a millionth of the wrench to several times the wrench.
        power = size.bit_length() - max(abs(x) for x in away).bit_length() + rng.choice((2, 0, -4, -rng.randint(8, 36)))
        shift = max(0, -power)
        wrench = [(x << shift) + (d << power + shift) for x, d in zip(wrench, away, strict=True)]
        least -= shift
        outside = float(np.linalg.norm([ldexp(float(d), power + shift + least) for d in away]))
    found = _cost(rng, cables.A, limits, (rows, columns, loads), place, precision)
    if found is None or not all(_fits(x, digits) for x in wrench):
        return None
    t_ref, weights, multipliers = found
    given = [longer if i >= 3 and n == 6 else 0 for i in range(n)]
    entries = [[ldexp(a, rows[i] + columns[c] + given[i]) for c, a in enumerate(row)] for i, row in enumerate(cables.A)]
    if not all(_fits(a, digits) for row in cables.A for a in row):
        return None
    low, high = (
        [default if x is None else ldexp(x, loads[c]) for c, x in enumerate(side)]
        for side, default in ((limits.low, -np.inf), (limits.high, np.inf))
    )
    return ExactProblem(
        np.array(entries),
        np.array([ldexp(x, least + given[i]) for i, x in enumerate(wrench)]),
        np.array(low),
        np.array(high),
        t_ref,
        weights,
        2.0**longer,
        multipliers,
        outside,
        place,
        cables.rough or rough or uneven,
    )


def _fits(x: int, digits: int) -> bool:
    """Return whether so many binary digits are enough for an integer."""
    return x == 0 or (abs(x) >> (x & -x).bit_length() - 1).bit_length() <= digits


def _powers(rng: Random, count: int, far: int) -> tuple[list[int], bool]:
    """Draw powers of two, and return whether they are far apart."""
    most = min(far, rng.choices((0, 4, 99), (60, 20, 20))[0])
    return [rng.randint(-most, most) for _ in range(count)], most > 4


def _cables(rng: Random, n: int, m: int, plain: bool) -> _Cables:
    """Draw a matrix: some are sparse, some of less than full rank, some have parallel or nearly parallel cables."""
    size, dense = rng.choice((1, 3, 10, 100)), rng.choice((0.4, 0.8, 1.0))
    A = [[rng.randint(-size, size) if rng.random() < dense else 0 for _ in range(m)] for _ in range(n)]
    columns, loads = [0] * m, [0] * m
    if rng.random() < 0.25:
        rank = rng.randint(1, n)
        for row in range(rank, n):
            factors = [rng.randint(-2, 2) for _ in range(rank)]
            A[row] = [sum(f * A[i][c] for i, f in enumerate(factors)) for c in range(m)]
    kind = rng.random()
    one, other = rng.randrange(m), rng.randrange(m)
    if kind < 0.2:
        factor = rng.choice((-1, 1, 2))
        for row in A:
            row[other] = factor * row[one]
    rough = not plain and 0.2 <= kind < 0.5 and one != other
    if rough and kind < 0.35:  # parallel but for 2^-23
        side = rng.choice((-1, 1))
        for row in A:
            row[other] = side * (row[one] << NEAR) + rng.randint(-2, 2)
        columns[other] = -NEAR
    elif rough:  # opposed, and together they pull a little aside: their tensions are as much larger
        power = rng.randint(15, 40)
        for row in A:
            row[one] = (row[one] << power) + rng.randint(-1, 1)
            row[other] = -row[one] + 2 * rng.randint(-1, 1)
        columns[one] = columns[other] = -power
        loads[one] = loads[other] = power - rng.randint(0, 14)
    return _Cables(A, columns, loads, rough)


def _normal(rng: Random, n: int) -> list[int]:
    """Draw the normal of a face."""
    most = rng.choice((1, 3, 10))
    normal = [rng.choice((0, rng.randint(-most, most))) for _ in range(n)]
    if not any(normal):
        normal[rng.randrange(n)] = rng.choice((-1, 1))
    return normal


def _turn(A: Matrix, c: int, normal: list[int]) -> None:
    """Take away the part of column c along a normal; the column is multiplied by the normal's square."""
    along, square = _pull(A, c, normal), sum(d * d for d in normal)
    for d, row in zip(normal, A, strict=True):
        row[c] = row[c] * square - along * d


def _pull(A: Matrix, c: int, normal: list[int]) -> int:
    return sum(d * row[c] for d, row in zip(normal, A, strict=True))


def _limits(rng: Random, cables: _Cables, normal: list[int] | None, place: str, unlimited: bool) -> _Limits:
    """Draw limits, and tensions inside: on the face of a normal they are those of the largest pull along it."""
    size = rng.choice((2, 10, 100, 1000))
    low: list[int | None] = []
    high: list[int | None] = []
    t: list[int] = []
    fixed = 0.3 if rng.random() < 0.2 else 0.0
    for c in range(len(cables.columns)):
        lowest = rng.choice((0, rng.randint(0, size), rng.randint(-size, size)))
        highest = lowest if rng.random() < fixed else lowest + rng.randint(2, 2 * size)
        pull = _pull(cables.A, c, normal) if normal else 0
        if pull != 0:
            at = highest if pull > 0 else lowest
        elif place == "corner" or (place != "inside" and rng.random() < 0.3):
            at = rng.choice((lowest, highest))
        else:
            at = rng.randint(min(lowest + 1, highest), max(highest - 1, lowest))
        open_above = unlimited and lowest < highest and pull <= 0 and rng.random() < 0.4
        open_below = unlimited and lowest < highest and pull >= 0 and rng.random() < 0.2
        low.append(None if open_below else lowest)
        high.append(None if open_above else highest)
        t.append(at)
    return _Limits(low, high, t)


def _cost(
    rng: Random,
    A: Matrix,
    limits: _Limits,
    powers_of: tuple[list[int], list[int], list[int]],
    place: str,
    precision: str,
) -> tuple[Array, Array, Array | None] | None:
    """Draw t_ref and weights, and multipliers if t is the optimum; None if a number does not fit."""
    rows, columns, loads = powers_of
    m, kind, digits, far = len(loads), rng.random(), DIGITS[precision], WEIGHTS[precision]
    if kind < 0.4:
        return np.zeros(m), np.ones(m), None
    if kind < 0.6 or place in ("outside", "off range"):
        wish = [ldexp(rng.randint(-20, 20), x) for x in loads]
        return np.array(wish), np.array([2.0 ** rng.randint(-10 * far // 20, 10 * far // 20) for _ in loads]), None
    # omega (t - t_ref) = (S A)^T y + mu: with weights that undo the scale of a column, t_ref is of the size of t.
    middle = sorted(loads)[m // 2]
    powers = [max(-far, min(far, 2 * (middle - x) + rng.choice((0, rng.randint(-2, 2))))) for x in loads]
    height = middle - sorted(a + b for a, b in zip(columns, loads, strict=True))[m // 2] + rng.randint(-6, 3)
    size = rng.choice((1, 5, 30))
    y = [rng.randint(-size, size) for _ in rows]
    scale = [middle + height - r for r in rows]
    t_ref = []
    for c, load in enumerate(loads):
        push = 0 if rng.random() < 0.2 else rng.randint(0, 4 * size)
        push = push if limits.t[c] == limits.low[c] else -push if limits.t[c] == limits.high[c] else 0
        # (S A)^T y and mu are integers times 2^(columns + middle + height).
        gradient = sum(A[i][c] * value for i, value in enumerate(y)) + push
        power = columns[c] + middle + height - powers[c]
        least = min(power, load)
        wish = (limits.t[c] << load - least) - (gradient << power - least)
        if not _fits(wish, digits):
            return None
        t_ref.append(ldexp(wish, least))
    multipliers = [ldexp(value, power) for value, power in zip(y, scale, strict=True)]
    return np.array(t_ref), np.array([2.0**x for x in powers]), np.array(multipliers)
