"""Kernel: cables without stiffness, which hold the distance of their ends to at most L0, and impacts of such cables.

With the Jacobian J of their elongations and the mass matrix M, tensions change the elongations' accelerations by
-G t, G = J M^-1 J^T, and impulses p their rates by -G p. Unilateral contact is

    x >= 0,  G x - c >= 0,  x (G x - c) = 0

with c what the elongations would do without cables. These are the conditions of min 1/2 x G x - c x over x >= 0, a
non-negative least-squares problem in the metric M^-1 (Gauss's principle of least constraint). An impact changes the
kinetic energy by -1/2 p G p where nothing else moves: it never grows. Where more cables are taut than their Jacobian
has rank, tensions are not unique: the solution has those of cables that stretch a little, all of the same E A.

Source: C. Lawson, R. Hanson, Solving Least Squares Problems, 1974, chapter 23, with a Cholesky factor of G.
"""

import math

from .layout import (
    ARM,
    BARRED,
    BODY,
    CANDIDATE,
    CARRIER_ARM,
    CARRIER_TURN,
    CONDITION,
    CURVATURE,
    DEPENDENT,
    DRIVE,
    FORCES,
    FREE,
    GIVE,
    GIVING,
    IMPULSE,
    INERTIA_OF_WINCH,
    INVERSE_INERTIA,
    INVERSE_MASS,
    LENGTH_RATE,
    MOTION,
    OMEGA,
    OWNER,
    PICKED,
    RATE,
    REFINED,
    SLIP,
    TURN,
    VELOCITY,
    WORKS,
    L,
    U,
)


def gram_matrix(bodies, cables, settings, state, on_bodies, on_cables, square):
    """Write G, (m, m), into `square`, and the angular accelerations per newton of all cables."""
    m, places = cables.shape[0], BODY * bodies.shape[0]
    for i in range(m):
        _turning(bodies, on_bodies, on_cables, i, 0, ARM, TURN)
        if bodies[int(cables[i, OWNER]), MOTION] == FREE:
            _turning(bodies, on_bodies, on_cables, i, int(cables[i, OWNER]), CARRIER_ARM, CARRIER_TURN)
    for i in range(m):
        for j in range(i + 1):
            total = _coupling(bodies, on_cables, i, j, 0, ARM, TURN)
            if cables[i, OWNER] == cables[j, OWNER] and bodies[int(cables[i, OWNER]), MOTION] == FREE:
                total += _coupling(bodies, on_cables, i, j, int(cables[i, OWNER]), CARRIER_ARM, CARRIER_TURN)
            square[i, j] = square[j, i] = total
        square[i, i] += yielding(cables, settings, state, on_cables, places, i)
    total, length = 0.0, 1e-300
    for i in range(m):
        total += square[i, i]
        length += on_cables[i, L]
    for i in range(m):
        on_cables[i, GIVE] = GIVING * total * on_cables[i, L] / length


def yielding(cables, settings, state, on_cables, places, i):
    """Return 1 / J of a winch that the tension moves [1/kg], else 0."""
    free = settings[DRIVE] == FORCES and on_cables[i, SLIP] != 0.0
    if free and state[places + CONDITION * cables.shape[0] + i] == WORKS:
        return 1.0 / cables[i, INERTIA_OF_WINCH]
    return 0.0


def _turning(bodies, on_bodies, on_cables, i, b, arm, turn):
    """Write the angular acceleration in {G} of body `b` per newton of cable `i`."""
    ux, uy, uz = on_cables[i, U], on_cables[i, U + 1], on_cables[i, U + 2]
    rx, ry, rz = on_cables[i, arm], on_cables[i, arm + 1], on_cables[i, arm + 2]
    mx, my, mz = ry * uz - rz * uy, rz * ux - rx * uz, rx * uy - ry * ux
    R, V = on_bodies, bodies
    px = R[b, 0] * mx + R[b, 3] * my + R[b, 6] * mz
    py = R[b, 1] * mx + R[b, 4] * my + R[b, 7] * mz
    pz = R[b, 2] * mx + R[b, 5] * my + R[b, 8] * mz
    k = INVERSE_INERTIA
    qx = V[b, k] * px + V[b, k + 1] * py + V[b, k + 2] * pz
    qy = V[b, k + 3] * px + V[b, k + 4] * py + V[b, k + 5] * pz
    qz = V[b, k + 6] * px + V[b, k + 7] * py + V[b, k + 8] * pz
    for axis in range(3):
        row = 3 * axis
        on_cables[i, turn + axis] = R[b, row] * qx + R[b, row + 1] * qy + R[b, row + 2] * qz


def _coupling(bodies, on_cables, i, j, b, arm, turn):
    """Return what body `b` adds to G[i, j]."""
    total = 0.0
    for axis in range(3):
        total += on_cables[i, U + axis] * bodies[b, INVERSE_MASS + axis] * on_cables[j, U + axis]
    ux, uy, uz = on_cables[i, U], on_cables[i, U + 1], on_cables[i, U + 2]
    rx, ry, rz = on_cables[i, arm], on_cables[i, arm + 1], on_cables[i, arm + 2]
    total += (ry * uz - rz * uy) * on_cables[j, turn] + (rz * ux - rx * uz) * on_cables[j, turn + 1]
    return total + (rx * uy - ry * ux) * on_cables[j, turn + 2]


def free_stretch_acceleration(bodies, cables, state, change, on_bodies, on_cables, i):
    """Return d2e/dt2 [m/s^2] of cable `i` for the accelerations in `change`."""
    c, m, places = int(cables[i, OWNER]), cables.shape[0], BODY * bodies.shape[0]
    px, py, pz, vx, vy, vz = _moved(state, change, on_bodies, on_cables, i, 0, ARM)
    cx, cy, cz, wx, wy, wz = _moved(state, change, on_bodies, on_cables, i, c, CARRIER_ARM)
    ox, oy, oz = on_bodies[c, OMEGA], on_bodies[c, OMEGA + 1], on_bodies[c, OMEGA + 2]
    wx, wy, wz = vx - wx, vy - wy, vz - wz
    ax = px - cx - 2.0 * (oy * wz - oz * wy)
    ay = py - cy - 2.0 * (oz * wx - ox * wz)
    az = pz - cz - 2.0 * (ox * wy - oy * wx)
    away = on_cables[i, U] * ax + on_cables[i, U + 1] * ay + on_cables[i, U + 2] * az
    return on_cables[i, CURVATURE] - away - change[places + LENGTH_RATE * m + i]


def _moved(state, change, on_bodies, on_cables, i, b, arm):
    """Return acceleration and velocity in {G} of the point of body `b` that is where the cable is attached."""
    at = BODY * b
    rx, ry, rz = on_cables[i, arm], on_cables[i, arm + 1], on_cables[i, arm + 2]
    ox, oy, oz = on_bodies[b, OMEGA], on_bodies[b, OMEGA + 1], on_bodies[b, OMEGA + 2]
    p, q, r = change[at + RATE], change[at + RATE + 1], change[at + RATE + 2]
    ax = on_bodies[b, 0] * p + on_bodies[b, 1] * q + on_bodies[b, 2] * r
    ay = on_bodies[b, 3] * p + on_bodies[b, 4] * q + on_bodies[b, 5] * r
    az = on_bodies[b, 6] * p + on_bodies[b, 7] * q + on_bodies[b, 8] * r
    sx, sy, sz = oy * rz - oz * ry, oz * rx - ox * rz, ox * ry - oy * rx
    return (
        change[at + VELOCITY] + ay * rz - az * ry + oy * sz - oz * sy,
        change[at + VELOCITY + 1] + az * rx - ax * rz + oz * sx - ox * sz,
        change[at + VELOCITY + 2] + ax * ry - ay * rx + ox * sy - oy * sx,
        state[at + VELOCITY] + sx,
        state[at + VELOCITY + 1] + sy,
        state[at + VELOCITY + 2] + sz,
    )


def _append(on_cables, square, picks, at):
    """Write row `at` of the Cholesky factor of G over the picked cables; return False if it depends on those before."""
    m, one = square.shape[1], picks[PICKED, at]
    left = square[one, one] + on_cables[one, GIVE]
    for b in range(at):
        total = square[one, picks[PICKED, b]]
        for k in range(b):
            total -= square[m + at, k] * square[m + b, k]
        total /= square[m + b, b]
        square[m + at, b] = total
        left -= total * total
    square[m + at, at] = math.sqrt(max(left, 0.0))
    return left > DEPENDENT * square[one, one]


def _solve_picked(square, picks, count, on_cables, rounds):
    """Solve G z = c over the picked cables, with c in `IMPULSE`, into row 2 m of `square`.

    The factor is that of cables that give a little: each round after the first refines the solution to one of G.
    """
    m = square.shape[1]
    z, step = square[2 * m], square[2 * m + 2]
    for a in range(count):
        z[a] = 0.0
    for _ in range(rounds):
        for a in range(count):
            step[a] = on_cables[picks[PICKED, a], IMPULSE]
            for b in range(count):
                step[a] -= square[picks[PICKED, a], picks[PICKED, b]] * z[b]
            for k in range(a):
                step[a] -= square[m + a, k] * step[k]
            step[a] /= square[m + a, a]
        for a in range(count - 1, -1, -1):
            for k in range(a + 1, count):
                step[a] -= square[m + k, a] * step[k]
            step[a] /= square[m + a, a]
        for a in range(count):
            z[a] += step[a]


def solve_pulling(on_cables, square, picks):
    """Solve G x = c for the candidates; c is in `IMPULSE`, where x goes. All others get 0."""
    m, count = square.shape[1], 0
    for i in range(m):
        if picks[CANDIDATE, i] == 1:
            picks[PICKED, count] = i
            if _append(on_cables, square, picks, count):
                count += 1
    _solve_picked(square, picks, count, on_cables, REFINED)
    _store(square, picks, count, on_cables)


def _store(square, picks, count, on_cables):
    m = square.shape[1]
    for i in range(m):
        on_cables[i, IMPULSE] = 0.0
    for a in range(count):
        on_cables[picks[PICKED, a], IMPULSE] = square[2 * m, a]


def solve_non_negative(on_cables, square, picks):
    """Solve x >= 0, G x - c >= 0, x (G x - c) = 0 for the candidates; c is in `IMPULSE`, where x goes."""
    m, count, largest = square.shape[1], 0, 0.0
    x = square[2 * m + 1]
    for i in range(m):
        picks[BARRED, i] = 1 - picks[CANDIDATE, i]
        if picks[CANDIDATE, i] == 1:
            largest = max(largest, abs(on_cables[i, IMPULSE]))
    for _ in range(10 * m + 20):
        best, most = -1, 1e-13 * largest
        for i in range(m):
            if picks[BARRED, i] == 0:
                left = on_cables[i, IMPULSE]
                for a in range(count):
                    left -= square[i, picks[PICKED, a]] * x[a]
                if left > most:
                    best, most = i, left
        if best < 0:
            break
        picks[BARRED, best] = 1
        picks[PICKED, count] = best
        if not _append(on_cables, square, picks, count):
            continue
        x[count] = 0.0
        count = _bring_inside(on_cables, square, picks, count + 1, x)
    _solve_picked(square, picks, count, on_cables, REFINED)
    _store(square, picks, count, on_cables)


def _bring_inside(on_cables, square, picks, count, x):
    """Move x to the solution over the picked cables, without those that would push; return how many are left."""
    m = square.shape[1]
    z = square[2 * m]
    while True:
        _solve_picked(square, picks, count, on_cables, 1)
        share, first = 1.0, -1
        for a in range(count):
            if z[a] <= 0.0 and (first < 0 or x[a] < share * (x[a] - z[a])):
                share, first = x[a] / max(x[a] - z[a], 1e-300), a
        for a in range(count):
            x[a] += share * (z[a] - x[a])
        if first < 0:
            return count
        for i in range(m):  # what depended on the one that goes may not any more
            picks[BARRED, i] = 1 - picks[CANDIDATE, i]
        kept = 0
        for a in range(count):
            if a != first:
                picks[PICKED, kept], x[kept] = picks[PICKED, a], x[a]
                _append(on_cables, square, picks, kept)
                kept += 1
        count = kept
        for a in range(count):
            picks[BARRED, picks[PICKED, a]] = 1
