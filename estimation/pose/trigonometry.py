"""Kernel: angles in lanes of `simd`, made of its operations: processors have no vector instructions for them.

Both series are cut where they are below rounding.
"""

from __future__ import annotations

import math

from ...base.machine_code.simd import floor, magnitude, maximum, minimum, splat, sqrt, where

__all__ = ["angle", "cosine_and_sine"]

_SHALLOW = math.sqrt(2.0) - 1.0  # tan(22.5 degrees)


def cosine_and_sine(x):
    """Return cos(x) and sin(x), by Taylor's series of half the angle, which lies within a quarter turn."""
    half = 0.5 * (x - 2.0 * math.pi * floor(x * (0.5 / math.pi) + 0.5))
    square = -(half * half)
    cosine, sine, term = splat(1.0), splat(1.0), splat(1.0)
    for k in range(1, 11):
        term = term * (square * (1.0 / (2 * k - 1)))
        term = term * (1.0 / (2 * k))
        cosine = cosine + term
        sine = sine + term * (1.0 / (2 * k + 1))
    sine = sine * half
    unit = 1.0 / (cosine * cosine + sine * sine)
    return (cosine * cosine - sine * sine) * unit, 2.0 * cosine * sine * unit


def angle(y, x):
    """Return the angle of the vector (x, y) from the x axis, from -pi to pi, by the series of a quarter of it at most.

    The angle from the nearest of eight directions is at most 22.5 degrees, and its half has the tangent v.
    """
    far, near = maximum(magnitude(x), magnitude(y)), minimum(magnitude(x), magnitude(y))
    far = maximum(far, splat(1e-300))
    steep = near > _SHALLOW * far
    u = where(steep, near - far, near) / where(steep, near + far, far)
    v = u / (1.0 + sqrt(1.0 + u * u))
    square = -(v * v)
    total = splat(1.0 / 23.0)
    for k in range(11):
        total = total * square + 1.0 / (21 - 2 * k)
    result = 2.0 * v * total + where(steep, splat(0.25 * math.pi), splat(0.0))
    result = where(magnitude(y) > magnitude(x), 0.5 * math.pi - result, result)
    result = where(x < 0.0, math.pi - result, result)
    return where(y < 0.0, -result, result)
