"""Kernel: how platform and carriers stand and move, in {G}.

    R(q), omega = R Omega                     for a unit quaternion q and a rate Omega in the body's axes
    dq = q (0, Omega) / 2

Each coordinate of an imposed carrier is a polynomial of time. Its attitude goes from Euler angles
to the quaternion here, with Omega = P dTheta and alpha = dP dTheta + P ddTheta.
"""

import math

from .layout import (
    BODY,
    CARRIER,
    CARRIER_BANDWIDTH,
    COMMANDS,
    FORCE,
    FREE,
    IMPOSED,
    INERTIA,
    INVERSE_INERTIA,
    INVERSE_MASS,
    LAGGED,
    LIMITS,
    MOMENT,
    MOTION,
    MOVES,
    OMEGA,
    POLYNOMIAL,
    QUATERNION,
    RATE,
    REFERENCE_POSE,
    RESTS,
    TURNS,
    VELOCITY,
)


def place_bodies(bodies, command, state, change, on_bodies, cable_count, time):
    """Put imposed carriers where they are `time` [s] after the command began; write R and omega of all bodies.

    The references of lagged carriers at that time go to their places in the command.
    """
    carriers = COMMANDS + cable_count
    polynomials = carriers + CARRIER * (bodies.shape[0] - 1)
    for b in range(bodies.shape[0]):
        at, turned = BODY * b, bodies[b, MOTION] == FREE or time == 0.0
        if bodies[b, MOTION] == IMPOSED:
            turned = _impose(command, polynomials + POLYNOMIAL * (b - 1), state, change, at, time)
        elif bodies[b, MOTION] == LAGGED:
            reference, polynomial = carriers + CARRIER * (b - 1) + REFERENCE_POSE, polynomials + POLYNOMIAL * (b - 1)
            for i in range(3 if command[polynomial + MOVES] != 0.0 else 0):
                command[reference + i] = _position(command, polynomial + 6 * i, time)
                command[reference + 6 + i] = _velocity(command, polynomial + 6 * i, time)
                command[reference + 12 + i] = _acceleration(command, polynomial + 6 * i, time)
        if not turned:
            continue  # it has the attitude of the beginning
        w, x = state[at + QUATERNION], state[at + QUATERNION + 1]
        y, z = state[at + QUATERNION + 2], state[at + QUATERNION + 3]
        # Inside of a step its norm leaves one by the error of the step.
        double = 2.0 / (w * w + x * x + y * y + z * z)
        on_bodies[b, 0] = 1.0 - double * (y * y + z * z)
        on_bodies[b, 1] = double * (x * y - w * z)
        on_bodies[b, 2] = double * (x * z + w * y)
        on_bodies[b, 3] = double * (x * y + w * z)
        on_bodies[b, 4] = 1.0 - double * (x * x + z * z)
        on_bodies[b, 5] = double * (y * z - w * x)
        on_bodies[b, 6] = double * (x * z - w * y)
        on_bodies[b, 7] = double * (y * z + w * x)
        on_bodies[b, 8] = 1.0 - double * (x * x + y * y)
        p, q, r = state[at + RATE], state[at + RATE + 1], state[at + RATE + 2]
        on_bodies[b, OMEGA] = on_bodies[b, 0] * p + on_bodies[b, 1] * q + on_bodies[b, 2] * r
        on_bodies[b, OMEGA + 1] = on_bodies[b, 3] * p + on_bodies[b, 4] * q + on_bodies[b, 5] * r
        on_bodies[b, OMEGA + 2] = on_bodies[b, 6] * p + on_bodies[b, 7] * q + on_bodies[b, 8] * r


def _position(command, at, time):
    c = command
    return c[at] + time * (c[at + 1] + time * (c[at + 2] + time * (c[at + 3] + time * (c[at + 4] + time * c[at + 5]))))


def _velocity(command, at, time):
    c = command
    return c[at + 1] + time * (
        2.0 * c[at + 2] + time * (3.0 * c[at + 3] + time * (4.0 * c[at + 4] + time * 5.0 * c[at + 5]))
    )


def _acceleration(command, at, time):
    c = command
    return 2.0 * c[at + 2] + time * (6.0 * c[at + 3] + time * (12.0 * c[at + 4] + time * 20.0 * c[at + 5]))


def _impose(command, polynomial, state, change, at, time):
    """Write an imposed body's motion; return whether its attitude may be another than before."""
    for i in range(3):
        first = polynomial + 6 * i
        if command[polynomial + MOVES] == 0.0:
            state[at + i], state[at + VELOCITY + i], change[at + VELOCITY + i] = command[first], 0.0, 0.0
        else:
            state[at + i] = _position(command, first, time)
            state[at + VELOCITY + i] = _velocity(command, first, time)
            change[at + VELOCITY + i] = _acceleration(command, first, time)
    if time != 0.0 and command[polynomial + TURNS] == 0.0:
        for i in range(3):
            state[at + RATE + i] = change[at + RATE + i] = 0.0
        return False
    roll, pitch, yaw = polynomial + 18, polynomial + 24, polynomial + 30
    d_roll, d_pitch, d_yaw = (
        _velocity(command, roll, time),
        _velocity(command, pitch, time),
        _velocity(command, yaw, time),
    )
    dd_roll, dd_pitch, dd_yaw = (
        _acceleration(command, roll, time),
        _acceleration(command, pitch, time),
        _acceleration(command, yaw, time),
    )
    roll, pitch, yaw = _position(command, roll, time), _position(command, pitch, time), _position(command, yaw, time)
    set_quaternion(state, at + QUATERNION, roll, pitch, yaw)
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    state[at + RATE] = d_roll - sp * d_yaw
    state[at + RATE + 1] = cr * d_pitch + sr * cp * d_yaw
    state[at + RATE + 2] = -sr * d_pitch + cr * cp * d_yaw
    change[at + RATE] = dd_roll - sp * dd_yaw - cp * d_pitch * d_yaw
    change[at + RATE + 1] = (
        cr * dd_pitch - sr * d_roll * d_pitch + sr * cp * dd_yaw + (cr * cp * d_roll - sr * sp * d_pitch) * d_yaw
    )
    change[at + RATE + 2] = (
        -sr * dd_pitch - cr * d_roll * d_pitch + cr * cp * dd_yaw - (sr * cp * d_roll + cr * sp * d_pitch) * d_yaw
    )
    return True


def set_quaternion(place, at, roll, pitch, yaw):
    """Write the quaternion (w, x, y, z) of Rz(yaw) Ry(pitch) Rx(roll) into `place`, from index `at` on."""
    sr, cr = math.sin(0.5 * roll), math.cos(0.5 * roll)
    sp, cp = math.sin(0.5 * pitch), math.cos(0.5 * pitch)
    sy, cy = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    place[at] = cr * cp * cy + sr * sp * sy
    place[at + 1] = sr * cp * cy - cr * sp * sy
    place[at + 2] = cr * sp * cy + sr * cp * sy
    place[at + 3] = cr * cp * sy - sr * sp * cy


def normalise(bodies, state):
    """Give the quaternions of free bodies their length of one."""
    for b in range(bodies.shape[0]):
        if bodies[b, MOTION] == FREE:
            at = BODY * b + QUATERNION
            w, x, y, z = state[at], state[at + 1], state[at + 2], state[at + 3]
            inverse = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
            state[at], state[at + 1] = w * inverse, x * inverse
            state[at + 2], state[at + 3] = y * inverse, z * inverse


def move_bodies(bodies, settings, command, state, change, on_bodies, cable_count):
    """Write the time derivatives of the bodies' blocks, from the forces and moments on them."""
    for b in range(bodies.shape[0]):
        at, kind = BODY * b, bodies[b, MOTION]
        if kind in (IMPOSED, RESTS):
            continue  # the reference of an imposed carrier has given place, velocity and acceleration
        for i in range(3):
            change[at + i] = state[at + VELOCITY + i]
        if kind == LAGGED:
            reference = COMMANDS + cable_count + CARRIER * (b - 1) + REFERENCE_POSE
            _follow(bodies, settings, command, reference, state, change, b)
            continue
        p, q, r = state[at + RATE], state[at + RATE + 1], state[at + RATE + 2]
        w, x = state[at + QUATERNION], state[at + QUATERNION + 1]
        y, z = state[at + QUATERNION + 2], state[at + QUATERNION + 3]
        change[at + QUATERNION] = -0.5 * (x * p + y * q + z * r)
        change[at + QUATERNION + 1] = 0.5 * (w * p + y * r - z * q)
        change[at + QUATERNION + 2] = 0.5 * (w * q + z * p - x * r)
        change[at + QUATERNION + 3] = 0.5 * (w * r + x * q - y * p)
        mx, my, mz = on_bodies[b, MOMENT], on_bodies[b, MOMENT + 1], on_bodies[b, MOMENT + 2]
        hx = bodies[b, INERTIA] * p + bodies[b, INERTIA + 1] * q + bodies[b, INERTIA + 2] * r
        hy = bodies[b, INERTIA + 3] * p + bodies[b, INERTIA + 4] * q + bodies[b, INERTIA + 5] * r
        hz = bodies[b, INERTIA + 6] * p + bodies[b, INERTIA + 7] * q + bodies[b, INERTIA + 8] * r
        nx = on_bodies[b, 0] * mx + on_bodies[b, 3] * my + on_bodies[b, 6] * mz - (q * hz - r * hy)
        ny = on_bodies[b, 1] * mx + on_bodies[b, 4] * my + on_bodies[b, 7] * mz - (r * hx - p * hz)
        nz = on_bodies[b, 2] * mx + on_bodies[b, 5] * my + on_bodies[b, 8] * mz - (p * hy - q * hx)
        for i in range(3):
            change[at + VELOCITY + i] = bodies[b, INVERSE_MASS + i] * on_bodies[b, FORCE + i]
            row = INVERSE_INERTIA + 3 * i
            change[at + RATE + i] = bodies[b, row] * nx + bodies[b, row + 1] * ny + bodies[b, row + 2] * nz


def _follow(bodies, settings, command, reference, state, change, b):
    """Accelerate a lagged carrier: a = a_ref + 2 w (v* - v), v* = v_ref + w/2 (p_ref - p), cut at its limits.

    Without limits that is a critically damped lag of second order with bandwidth w. The wanted velocity v* is inside
    the limit of speed, and so v stays inside. From farther away it grows with the root of the distance, so that a
    carrier can brake with 0.8 of its largest acceleration. `place_bodies` has written the reference of the time.
    """
    at, rate = BODY * b, 0.5 * settings[CARRIER_BANDWIDTH]
    dx, dy, dz = (
        command[reference] - state[at],
        command[reference + 1] - state[at + 1],
        command[reference + 2] - state[at + 2],
    )
    square, most, share = dx * dx + dy * dy + dz * dz, 0.8 * bodies[b, LIMITS + 1], rate
    if square * rate**4 > most * most:
        away = math.sqrt(square)
        share = math.sqrt(most * (2.0 * away - most / (rate * rate))) / away
    vx = command[reference + 6] + share * dx
    vy = command[reference + 7] + share * dy
    vz = command[reference + 8] + share * dz
    square, most, share = vx * vx + vy * vy + vz * vz, bodies[b, LIMITS], 1.0
    if square > most * most:
        share = most / math.sqrt(square)
    rate *= 4.0
    ax = command[reference + 12] + rate * (share * vx - state[at + VELOCITY])
    ay = command[reference + 13] + rate * (share * vy - state[at + VELOCITY + 1])
    az = command[reference + 14] + rate * (share * vz - state[at + VELOCITY + 2])
    square, most, share = ax * ax + ay * ay + az * az, bodies[b, LIMITS + 1], 1.0
    if square > most * most:
        share = most / math.sqrt(square)
    change[at + VELOCITY], change[at + VELOCITY + 1], change[at + VELOCITY + 2] = share * ax, share * ay, share * az
