"""The z of least norm inside slabs in up to two dimensions, one slab after another (Seidel 1991)."""

from __future__ import annotations

import math

import numpy as np

from .codes import PARALLEL
from .jit import jit

__all__ = ["nearest_in_slabs"]


@jit()
def nearest_in_slabs(N0, N1, s0, lower, upper, mm, slack, z, push):
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
        if square < PARALLEL * PARALLEL:
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
            if abs(den) < PARALLEL:
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
