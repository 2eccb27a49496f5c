"""Kernel: the second derivative of the lengths, which Gauss and Newton's matrix leaves out.

With the unit vector n along which a cable reaches its attachment, at r from the platform frame's origin, its length
changes to second order by

    (dx, dphi)^T H (dx, dphi) / 2      H = G^T T G + (0, 0; 0, (r n^T + n r^T) / 2 - (r . n) 1)      G = (1, -[r])

where T, the derivative of n by the attachment, is (1 - n n^T) / s + (sin(theta) / a - 1 / s) f f^T: s is the free part,
f the normal of the sheave's plane, a the distance from the swivel axis; without a pulley the last term is zero.
"""

from __future__ import annotations

from ...base.machine_code.simd import load, maximum, splat, sqrt, store
from .lengths import BANK, CABLE, CABLES, POSE, SYSTEM, over_sheave

__all__ = ["add_curvature"]


def add_product(factor, a0, a1, a2, rx, ry, rz, free, W):
    """Add factor G^T a a^T G to the lower triangle of the system."""
    b0, b1, b2 = ry * a2 - rz * a1, rz * a0 - rx * a2, rx * a1 - ry * a0
    vector = (a0 * free[0], a1 * free[1], a2 * free[2], b0 * free[3], b1 * free[4], b2 * free[5])
    for j in range(6):
        for k in range(j + 1):
            at = SYSTEM + j * (j + 1) // 2 + k
            store(W, at, load(W, at) + factor * vector[j] * vector[k])


def add_curvature(now, m, radii, weights, free, W):
    """Add the sum of H times the errors of the lengths to J^T J, at the pose in W with the errors of a bank."""
    zero, one = splat(0.0), splat(1.0)
    for i in range(m):
        cable = CABLES + CABLE * i
        bx, by, bz = load(W, cable + 3), load(W, cable + 4), load(W, cable + 5)
        rx = load(W, POSE + 3) * bx + load(W, POSE + 4) * by + load(W, POSE + 5) * bz
        ry = load(W, POSE + 6) * bx + load(W, POSE + 7) * by + load(W, POSE + 8) * bz
        rz = load(W, POSE + 9) * bx + load(W, POSE + 10) * by + load(W, POSE + 11) * bz
        dx, dy = load(W, POSE) + rx - load(W, cable), load(W, POSE + 1) + ry - load(W, cable + 1)
        dz = load(W, POSE + 2) + rz - load(W, cable + 2)
        error = load(W, now + BANK * i + 6) * weights[i]
        if radii[i] == 0.0:
            straight = maximum(sqrt(dx * dx + dy * dy + dz * dz), splat(1e-12))
            nx, ny, nz = dx / straight, dy / straight, dz / straight
        else:
            kx, ky, kz = load(W, cable + 6), load(W, cable + 7), load(W, cable + 8)
            ex, ey, ez, sine, cosine, straight, distance = over_sheave(dx, dy, dz, kx, ky, kz, radii[i])
            nx, ny, nz = sine * ex + cosine * kx, sine * ey + cosine * ky, sine * ez + cosine * kz
            fx, fy, fz = ky * ez - kz * ey, kz * ex - kx * ez, kx * ey - ky * ex
            add_product(error * (sine / distance - 1.0 / straight), fx, fy, fz, rx, ry, rz, free, W)
        along = error / straight
        add_product(along, one, zero, zero, rx, ry, rz, free, W)
        add_product(along, zero, one, zero, rx, ry, rz, free, W)
        add_product(along, zero, zero, one, rx, ry, rz, free, W)
        add_product(-along, nx, ny, nz, rx, ry, rz, free, W)
        inside = error * (rx * nx + ry * ny + rz * nz)
        half = 0.5 * error
        turn = (
            2.0 * half * rx * nx - inside,
            half * (rx * ny + ry * nx),
            2.0 * half * ry * ny - inside,
            half * (rx * nz + rz * nx),
            half * (ry * nz + rz * ny),
            2.0 * half * rz * nz - inside,
        )
        for j in range(3):
            for k in range(j + 1):
                at = SYSTEM + (j + 3) * (j + 4) // 2 + k + 3
                store(W, at, load(W, at) + turn[j * (j + 1) // 2 + k] * (free[j + 3] * free[k + 3]))
