"""Kernel: how carriers move off their reference to help the tensions.

The wrench of tensions t at the places p of the carriers is A(p) t. To first order a wanted change of it is

    dw = A dt + G dp        G: moves or turns the cables of a carrier, with t_ref in them

of which the solution of least norm is taken, each coordinate of a carrier measured by its reach and each tension by a
share of the weight. Carriers go there as a critically damped lag of second order does: their command is smooth.

With as many cables as degrees of freedom or more, dw = -d, the disturbance: the carriers take over what is steady, and
the tensions correct errors. With fewer the carriers have to correct them too: dw = w - A t_ref where they are now, and
dp adds to the offset that they have.
"""

import math

from ..plant.layout import ARM, CARRIER_ARM, FORCE_SCALE, LENGTH_SCALE, OWNER, L, U

SHARE = 0.05  # of the weight: the change of a tension that costs as much as a carrier at the end of its reach
DAMPED = 1e-4  # of the largest entry of the gram matrix
OFFSET, OFFSET_RATE = 0, 1  # of the memory of a reaction
BANDWIDTH, STRONGEST, CORRECTS = 0, 1, 2  # of its gains


def react(settings, gains, dt, reach, cables, on_cables, A, missing, t_ref, memory, columns, gram, carriers):
    """Update the memory of a row, and add it to the motion that carriers should have.

    Parameters
    ----------
    gains
        BANDWIDTH of the lag [rad/s], its STRONGEST acceleration in a coordinate [m/s^2, rad/s^2], and 1 if it CORRECTS
        errors, else 0.
    reach
        (c, 6), how far each coordinate may go [m, rad].
    missing
        dw, (6,) [N, N m].
    memory
        (2, c, 6), offset and its rate.
    columns, gram
        Work, (6 c, 6) and (6, 7).
    carriers
        (c, 3, 6), pose, velocity and acceleration of the reference; those of the command afterwards.
    """
    bandwidth, most = gains[BANDWIDTH], gains[STRONGEST]
    scale = 1.0 / settings[LENGTH_SCALE]
    share = SHARE * settings[FORCE_SCALE]
    write_columns(scale, reach, cables, on_cables, t_ref, columns)
    largest = 0.0
    for j in range(6):
        by = 1.0 if j < 3 else scale
        gram[j, 6] = by * missing[j]
        for k in range(6):
            gram[j, k] = 0.0
            for i in range(A.shape[1]):
                gram[j, k] += share * share * by * (1.0 if k < 3 else scale) * A[j, i] * A[k, i]
            for c in range(columns.shape[0]):
                gram[j, k] += columns[c, j] * columns[c, k]
        largest = max(largest, gram[j, j])
    for j in range(6):
        gram[j, j] += DAMPED * largest + 1e-30
    solve_positive(gram)
    for c in range(reach.shape[0]):
        for k in range(6):
            offset, rate, change = memory[OFFSET, c, k], memory[OFFSET_RATE, c, k], 0.0
            for j in range(6):
                change += columns[6 * c + k, j] * gram[j, 6]
            wanted = gains[CORRECTS] * offset + change * reach[c, k]
            wanted = min(max(wanted, -reach[c, k]), reach[c, k])
            bend = bandwidth * (bandwidth * (wanted - offset) - 2.0 * rate)
            bend = min(max(bend, -most), most)
            if dt > 0.0:
                rate += dt * bend
                memory[OFFSET_RATE, c, k] = rate
                memory[OFFSET, c, k] = offset + dt * rate
    add_offsets(memory, carriers)


def add_offsets(memory, carriers):
    """Add the offsets of a memory, and their rates, to poses and velocities of carriers."""
    for c in range(carriers.shape[0]):
        turn = carriers[c, 0, 5]
        cy, sy = math.cos(turn), math.sin(turn)
        for order in range(2):
            for k in range(3):
                carriers[c, order, k] += memory[order, c, k]
            # Small rotations of a carrier that is nearly level, as angles.
            x, y = memory[order, c, 3], memory[order, c, 4]
            carriers[c, order, 3] += cy * x + sy * y
            carriers[c, order, 4] += cy * y - sy * x
            carriers[c, order, 5] += memory[order, c, 5]


def write_columns(scale, reach, cables, on_cables, t_ref, columns):
    """Write the change of the wrench, moments over the length scale, with each coordinate at the end of its reach."""
    for j in range(columns.shape[0]):
        for k in range(6):
            columns[j, k] = 0.0
    for i in range(cables.shape[0]):
        c = int(cables[i, OWNER]) - 1
        ux, uy, uz = on_cables[i, U], on_cables[i, U + 1], on_cables[i, U + 2]
        length = max(on_cables[i, L], 1e-9)
        # From the carrier's frame to the anchor.
        ax = on_cables[i, CARRIER_ARM] + length * ux
        ay = on_cables[i, CARRIER_ARM + 1] + length * uy
        az = on_cables[i, CARRIER_ARM + 2] + length * uz
        rx, ry, rz = on_cables[i, ARM], on_cables[i, ARM + 1], on_cables[i, ARM + 2]
        for k in range(6):
            far = reach[c, k]
            if far == 0.0 or t_ref[i] <= 0.0:
                continue
            if k == 0:
                dx, dy, dz = 1.0, 0.0, 0.0
            elif k == 1:
                dx, dy, dz = 0.0, 1.0, 0.0
            elif k == 2:
                dx, dy, dz = 0.0, 0.0, 1.0
            elif k == 3:
                dx, dy, dz = 0.0, -az, ay
            elif k == 4:
                dx, dy, dz = az, 0.0, -ax
            else:
                dx, dy, dz = -ay, ax, 0.0
            along, stiffness = ux * dx + uy * dy + uz * dz, far * t_ref[i] / length
            fx, fy, fz = stiffness * (dx - along * ux), stiffness * (dy - along * uy), stiffness * (dz - along * uz)
            columns[6 * c + k, 0] += fx
            columns[6 * c + k, 1] += fy
            columns[6 * c + k, 2] += fz
            columns[6 * c + k, 3] += scale * (ry * fz - rz * fy)
            columns[6 * c + k, 4] += scale * (rz * fx - rx * fz)
            columns[6 * c + k, 5] += scale * (rx * fy - ry * fx)


def solve_positive(gram):
    """Replace the last column of (n, n + 1) by the solution of the positive definite system, by elimination."""
    n = gram.shape[0]
    for k in range(n):
        for j in range(k + 1, n):
            factor = gram[j, k] / gram[k, k]
            for i in range(k, n + 1):
                gram[j, i] -= factor * gram[k, i]
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            gram[k, n] -= gram[k, i] * gram[i, n]
        gram[k, n] /= gram[k, k]
