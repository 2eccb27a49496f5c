"""The z of least norm inside slabs in up to two dimensions, one slab after another (Seidel 1991)."""

from __future__ import annotations

import math

import numpy as np

from .codes import DECISIVE, PARALLEL, SLACK, STATIONARY
from .jit import compilable

__all__ = ["nearest_in_slabs", "rounding_of"]


@compilable()
def nearest_in_slabs(N0, N1, s, lower, upper, mm, slack, push):
    """Move s (mm,) to the point of least norm in s + range (N0, N1).

    Return 0 if multipliers of the limits prove it, 1 and multipliers `push` if there is no such point, else 2.
    """
    z0, z1 = 0.0, 0.0
    last_moved, other, pull, pull_other = -1, -1, 0.0, 0.0
    for i in range(mm):
        a, b = N0[i], N1[i]
        value = s[i] + a * z0 + b * z1
        if value < lower[i] - slack:
            edge, side = lower[i] - s[i], -1.0
        elif value > upper[i] + slack:
            edge, side = upper[i] - s[i], 1.0
        else:
            continue
        square = a * a + b * b
        if square < PARALLEL * PARALLEL:
            push[i] = side
            return 1
        length = math.sqrt(square)
        along0, along1 = -b / length, a / length
        base0, base1 = a * edge / square, b * edge / square
        first, last = -np.inf, np.inf
        at_first, at_last = -1, -1
        den_first, den_last = 0.0, 0.0
        for j in range(i):
            den = N0[j] * along0 + N1[j] * along1
            here = s[j] + N0[j] * base0 + N1[j] * base1
            low, high = lower[j] - here, upper[j] - here
            if abs(den) < PARALLEL:
                if low > slack or high < -slack:
                    push[j] = -1.0 if low > slack else 1.0
                    push[i] = -push[j] * (N0[j] * a + N1[j] * b) / square
                    return 1
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
                return 1
            shift = 0.5 * (first + last)
        else:
            shift = min(max(0.0, first), last)
        z0, z1 = base0 + shift * along0, base1 + shift * along1
        # z is the sum of the two normals, each times its multiplier.
        other, pull_other = -1, 0.0
        if shift > 0.0:
            other, pull_other = at_first, shift / den_first
        elif shift < 0.0:
            other, pull_other = at_last, shift / den_last
        last_moved, pull = i, a * z0 + b * z1
        if other >= 0:
            pull -= pull_other * (N0[other] * a + N1[other] * b)
        pull *= -side / square
    square = 0.0
    for c in range(mm):
        s[c] += N0[c] * z0 + N1[c] * z1
        square += s[c] * s[c]
    if last_moved < 0:
        return 0
    a, b = N0[last_moved], N1[last_moved]
    wrong_sign = pull * math.sqrt(a * a + b * b) < -STATIONARY * math.sqrt(square)
    change = pull * rounding_of(lower[last_moved], upper[last_moved], slack)
    if other >= 0:
        change = max(change, abs(pull_other) * rounding_of(lower[other], upper[other], slack))
    return 2 if wrong_sign or change > DECISIVE * square else 0


@compilable()
def rounding_of(lower, upper, slack):
    """Return how far rounding may move a limit: relative to the limits themselves, at most the slack."""
    return min(slack, SLACK * max(abs(lower), abs(upper)))
