"""Kernel: how the references of carriers move during a command.

A command has the pose, the velocity and the acceleration of a reference at its beginning, and the next command has
those at its end; without a next one the acceleration is constant. In between each coordinate is the polynomial of fifth
degree in time that has position, velocity and acceleration of the reference at both ends. Where the end is not known it
has the fourth degree, and any acceleration there: Runge-Kutta integrates this without an error.

The motion of an imposed carrier begins with the position and the velocity that the carrier has. The end of the last
command may have missed its reference, by what a changing acceleration does in one step. So carriers move without jumps,
and a taut cable that never stretches stays taut. Where the reference is farther away than either moves in the step, or
so far that the way there needs an acceleration beyond `SUDDEN`, it has jumped, and the carrier does.
"""

import math

from .layout import (
    BODY,
    CARRIER,
    COMMANDS,
    IMPOSED,
    LAGGED,
    MOTION,
    MOVES,
    POLYNOMIAL,
    QUATERNION,
    RATE,
    REFERENCE_POSE,
    SUDDEN,
    TURNS,
    VELOCITY,
)


def set_motions(bodies, row, after, is_next, command, state, cable_count, period):
    """Write the polynomials of imposed and lagged carriers into `command`, of what was commanded, `row`.

    Their ends are at the beginning of the row `after` if that is the next one.
    """
    polynomials = COMMANDS + cable_count + CARRIER * (bodies.shape[0] - 1)
    for b in range(1, bodies.shape[0]):
        if bodies[b, MOTION] != IMPOSED and bodies[b, MOTION] != LAGGED:
            continue
        reference, polynomial = (
            polynomials - CARRIER * (bodies.shape[0] - b) + REFERENCE_POSE,
            polynomials + POLYNOMIAL * (b - 1),
        )
        missed = bodies[b, MOTION] == IMPOSED and _go_on(row, reference, command, polynomial, state, BODY * b, period)
        ends_known = is_next and _leads_on(row, reference, after, period)
        command[polynomial + MOVES] = command[polynomial + TURNS] = 0.0
        for i in range(6 if bodies[b, MOTION] == IMPOSED else 3):
            at, p, v, a = polynomial + 6 * i, row[reference + i], row[reference + 6 + i], row[reference + 12 + i]
            off, faster = (command[at], command[at + 1]) if missed else (0.0, 0.0)
            command[at], command[at + 1], command[at + 2] = p + off, v + faster, 0.5 * a
            command[at + 3] = command[at + 4] = command[at + 5] = 0.0
            gap, speed = -off - faster * period, -faster * period
            bend = 6.0 * speed - 12.0 * gap  # all of them lengths, or angles; this makes the fifth coefficient 0
            if missed or ends_known:
                if ends_known:  # how far away from where a constant acceleration leads
                    gap += after[reference + i] - p - period * (v + 0.5 * period * a)
                    speed += period * (after[reference + 6 + i] - v - period * a)
                    bend = period * period * (after[reference + 12 + i] - a)
                cube = period * period * period
                command[at + 3] = (10.0 * gap - 4.0 * speed + 0.5 * bend) / cube
                command[at + 4] = (7.0 * speed - 15.0 * gap - bend) / (cube * period)
                command[at + 5] = (6.0 * gap - 3.0 * speed + 0.5 * bend) / (cube * period * period)
            if v != 0.0 or a != 0.0 or gap != 0.0 or speed != 0.0 or bend != 0.0:
                command[polynomial + (MOVES if i < 3 else TURNS)] = 1.0


def _leads_on(row, reference, after, period):
    """Return whether the reference of a carrier goes on to that of the next command, and does not jump there."""
    for first in range(reference, reference + 6, 3):  # translation, and then rotation
        away, way = 0.0, 0.0
        for i in range(first, first + 3):
            off = after[i] - row[i] - period * (row[i + 6] + 0.5 * period * row[i + 12])
            faster = after[i + 6] - row[i + 6] - period * row[i + 12]
            away += abs(off)
            way += period * (abs(row[i + 6]) + abs(after[i + 6]) + 0.5 * period * abs(row[i + 12]))
            if 6.0 * abs(off) + 4.0 * period * abs(faster) > SUDDEN * period * period:
                return False
        if away > way:
            return False
    return True


def _go_on(row, reference, command, polynomial, state, at, period):
    """Write by how much a carrier is away from its reference, and how much faster, for each coordinate of a polynomial.

    Return whether it continues from where it is: False if it is on its reference, or jumps there.
    """
    w, x, y, z = (
        state[at + QUATERNION],
        state[at + QUATERNION + 1],
        state[at + QUATERNION + 2],
        state[at + QUATERNION + 3],
    )
    p, q, r = state[at + RATE], state[at + RATE + 1], state[at + RATE + 2]
    command[polynomial + 18] = command[polynomial + 24] = command[polynomial + 30] = 0.0
    command[polynomial + 19], command[polynomial + 25], command[polynomial + 31] = p, q, r
    if x != 0.0 or y != 0.0 or z != 0.0:
        sine, rolled, upright = 2.0 * (w * y - x * z), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
        cosine = max(math.sqrt(rolled * rolled + upright * upright), 1e-300)
        sr, cr = rolled / cosine, upright / cosine
        d_yaw = (sr * q + cr * r) / cosine
        command[polynomial + 18], command[polynomial + 19] = math.atan2(rolled, upright), p + sine * d_yaw
        command[polynomial + 24], command[polynomial + 25] = math.atan2(sine, cosine), cr * q - sr * r
        command[polynomial + 30], command[polynomial + 31] = (
            math.atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)),
            d_yaw,
        )
    sudden, missed = False, False
    for first in range(0, 6, 3):  # translation, and then rotation
        away, way = 0.0, 0.0
        for i in range(first, first + 3):
            p, v, a = row[reference + i], row[reference + 6 + i], row[reference + 12 + i]
            if i < 3:
                off, fast = state[at + i] - p, state[at + VELOCITY + i]
            else:
                off, fast = command[polynomial + 6 * i] - p, command[polynomial + 6 * i + 1]
                off -= 2.0 * math.pi * math.floor(0.5 + off / (2.0 * math.pi))
            faster = fast - v
            # Rounding would make a carrier that rests turn, and short steps shake it.
            off = off if abs(off) > 1e-15 * (1.0 + abs(p)) else 0.0
            faster = faster if abs(faster) > 1e-14 * (1.0 + abs(v)) else 0.0
            missed = missed or off != 0.0 or faster != 0.0
            away += abs(off)
            way += period * (abs(v) + abs(fast) + 0.5 * period * abs(a))
            sudden = sudden or 6.0 * abs(off) + 4.0 * period * abs(faster) > SUDDEN * period * period
            command[polynomial + 6 * i], command[polynomial + 6 * i + 1] = off, faster
        sudden = sudden or away > way
    return missed and not sudden
