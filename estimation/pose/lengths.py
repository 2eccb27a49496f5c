"""Kernel: cable lengths and their gradient at many poses, one a lane of `simd`.

With d = B - A from the anchor of a cable to its attachment, the gradient of its length is the unit vector n along which
the cable reaches B:

    dl = n . dx + (R b x n) . dphi

for a displacement dx of the platform frame and a small rotation dphi, both in {G}. Over a pulley length and direction
are those of `models.cables.pulley`, whose two angles are one here: the wrap is the angle of n from the swivel axis,
from 0 to 2 pi.

The rows of the work array, of one vector each: a pose as x and the rows of R, a step's trial pose, the normal
equations, the step; then ten a cable, its geometry and length; then two banks of seven a cable, the gradient and the
error of its length in standard deviations, times a common factor.
"""

from __future__ import annotations

import math

from ...base.machine_code.simd import load, maximum, splat, sqrt, store, where
from .trigonometry import angle

__all__ = ["BANK", "CABLE", "CABLES", "POSE", "STEP", "SYSTEM", "TRIAL", "bank", "lengths_at", "over_sheave", "rows_of"]

POSE, TRIAL, SYSTEM, STEP, CABLES = 0, 12, 24, 45, 51
CABLE, BANK = 10, 7  # rows for each cable


def bank(which, m):
    """Return the first row of one of two banks of gradients and errors."""
    return CABLES + CABLE * m + BANK * m * which


def rows_of(m):
    """Return how many rows the work array has; the last m are the errors of what has ended."""
    return bank(2, m) + m


def over_sheave(dx, dy, dz, kx, ky, kz, radius):
    """Return e (three), sine and cosine of the wrap, the free part's length, and the distance from the swivel axis."""
    up = dx * kx + dy * ky + dz * kz
    ex, ey, ez = dx - up * kx, dy - up * ky, dz - up * kz
    distance = maximum(sqrt(ex * ex + ey * ey + ez * ez), splat(1e-12))
    inverse, out = 1.0 / distance, distance - radius
    # Inside the sheave there is no tangent; then the free part has no length.
    straight = sqrt(maximum(distance * distance - 2.0 * radius * distance + up * up, splat(1e-18)))
    inverse_square = 1.0 / (out * out + up * up)
    sine = (straight * out + radius * up) * inverse_square
    cosine = (straight * up - radius * out) * inverse_square
    return ex * inverse, ey * inverse, ez * inverse, sine, cosine, straight, distance


def lengths_at(place, into, m, radii, weights, free, W):
    """Write gradients and errors at the pose in the rows from `place`, and return the sum of squared errors."""
    x, y, z = load(W, place), load(W, place + 1), load(W, place + 2)
    r0, r1, r2 = load(W, place + 3), load(W, place + 4), load(W, place + 5)
    r3, r4, r5 = load(W, place + 6), load(W, place + 7), load(W, place + 8)
    r6, r7, r8 = load(W, place + 9), load(W, place + 10), load(W, place + 11)
    cost = splat(0.0)
    for i in range(m):
        cable, row = CABLES + CABLE * i, into + BANK * i
        bx, by, bz = load(W, cable + 3), load(W, cable + 4), load(W, cable + 5)
        rx, ry, rz = r0 * bx + r1 * by + r2 * bz, r3 * bx + r4 * by + r5 * bz, r6 * bx + r7 * by + r8 * bz
        dx, dy, dz = x + rx - load(W, cable), y + ry - load(W, cable + 1), z + rz - load(W, cable + 2)
        if radii[i] == 0.0:
            length = sqrt(dx * dx + dy * dy + dz * dz)
            inverse = 1.0 / maximum(length, splat(1e-12))
            nx, ny, nz = dx * inverse, dy * inverse, dz * inverse
        else:
            kx, ky, kz = load(W, cable + 6), load(W, cable + 7), load(W, cable + 8)
            ex, ey, ez, sine, cosine, straight, _ = over_sheave(dx, dy, dz, kx, ky, kz, radii[i])
            wrap = angle(sine, cosine)
            length = straight + radii[i] * where(wrap < 0.0, wrap + 2.0 * math.pi, wrap)
            nx, ny, nz = sine * ex + cosine * kx, sine * ey + cosine * ky, sine * ez + cosine * kz
        weight = weights[i]
        store(W, row, nx * (weight * free[0]))
        store(W, row + 1, ny * (weight * free[1]))
        store(W, row + 2, nz * (weight * free[2]))
        store(W, row + 3, (ry * nz - rz * ny) * (weight * free[3]))
        store(W, row + 4, (rz * nx - rx * nz) * (weight * free[4]))
        store(W, row + 5, (rx * ny - ry * nx) * (weight * free[5]))
        error = (length - load(W, cable + 9)) * weight
        store(W, row + 6, error)
        cost = cost + error * error
    return cost
