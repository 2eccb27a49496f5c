"""Kernel: what one step of a controller needs of a robot's mechanics, for each row of a batch.

    a* = a_ref + Kd (v_ref - v) + Kp (x_ref - x) + Ki integral           in the coordinates of the pose, angles by turns
    w  = (m (a_c - g), R (J alpha + Omega x J Omega)) - d                 about the CoM
    d  = K (p - p_0 - integral of (A t + m g + d))                        the estimated disturbance, p the momentum

The Euler angles' derivatives give the rate Omega and its derivative alpha in the platform's axes. Carriers take part by
their places alone: what they do moves the anchors, not the platform.
"""

import math

import numpy as np

from ..plant.bodies import place_bodies, set_quaternion
from ..plant.layout import (
    ARM,
    BODY,
    BODY_WORK,
    CABLE_BLOCKS,
    CABLE_WORK,
    CARRIER,
    COMMANDS,
    GRAVITY,
    INERTIA,
    OMEGA,
    QUATERNION,
    RATE,
    SETTINGS,
    VELOCITY,
    U,
)
from ..plant.lines import run_cables
from .carrier_compensation import CORRECTS, add_offsets, react

# Rows of `gains`, and places in `settings` behind those of `layout`. The row of the carriers has what
# `carrier_compensation` reads, and WINCHES, the bandwidth with which tensions are learned that differ from their
# commands [rad/s].
KP, KD, KI, OBSERVER, CARRIERS, GAINS = 0, 1, 2, 3, 4, 5
WINCHES = 3
COM, TOTAL_MASS = SETTINGS, SETTINGS + 3
# Rows of `limits`, and the share of its upper limit that a cable must be commanded to count as cut.
LOWEST, HIGHEST, RATE_MAX = 0, 1, 2
SOMETHING = 1e-3
# No sensor reports more [m, rad, m/s, rad/s, N]; beyond, squares would fill the memory with infinities.
LARGEST = 1e9
# Rows of `pulls`: tensions until the state was measured, by sensors or else as commanded, the last command, what of the
# first the observers know, and what was commanded until then.
MEASURED, LAST, KNOWN, THEN, PULLS = 0, 1, 2, 3, 4
# Rows of `heard`: tension reported and tension commanded, smoothed, 1 for a cable that counts as cut, and by how much
# the report exceeds the command in the long run. It counts as cut once it reports less than `LITTLE` of what it is
# commanded, which takes the patience if it reports nothing. It counts again once it reports `ENOUGH` of the little that
# it is commanded then.
REPORTED, COMMANDED, IS_CUT, EXCESS, HEARD = 0, 1, 2, 3, 4
LITTLE, ENOUGH = 0.1, 0.5
# Rows of `memory`: integral of the error, estimated disturbance, and momentum less what the estimate explains.
INTEGRAL, DISTURBANCE, EXPLAINED, MEMORY = 0, 1, 2, 3


def write_rows(
    robot,
    gains,
    limits,
    reach,
    patience,
    dt,
    since,
    late,
    measured,
    reference,
    t_ref,
    pulls,
    heard,
    integrates,
    memory,
    reactions,
    carriers,
    A,
    w,
    bounds,
):
    """Update the memory of each row of a batch, and write its wrench matrix, wrench and bounds of tensions.

    A row with a number that is not finite or beyond LARGEST, or a cable without length, keeps its memory, and gets a
    wrench of nan.

    Parameters
    ----------
    robot
        Bodies, each of them free, cables and settings in the columns of `layout`, and (6,), 1 for the platform's
        degrees of freedom, else 0.
    gains
        (5, 6), rows KP, KD, KI, OBSERVER and CARRIERS.
    limits
        (3, m), rows LOWEST and HIGHEST tension [N] and RATE_MAX [N/s].
    reach
        (c, 6), how far carriers may go off their reference to help the tensions [m, rad]; (0, 6): they do not.
    patience
        For how long a cable may report no tension where one is commanded until it counts as cut [s]; inf: for ever.
    dt
        Time since the last step [s]; 0 in the first one, which starts the memory and has no bounds by rates.
    since
        Time between the measurement of the last state and that of this one [s].
    late
        (N, 1 + c, 12), pose and velocity of the platform and of each carrier when they were measured, which the
        observer compares; (0, 1 + c, 12): now.
    measured
        (N, 1 + c, 12), the same now.
    reference
        (N, 18), pose, velocity and acceleration of the platform.
    t_ref
        (N, m), tensions to stay near [N].
    pulls
        (N, 4, m), rows MEASURED, LAST, KNOWN and THEN [N]; KNOWN is written.
    heard
        (N, 4, m), rows REPORTED and COMMANDED [N], IS_CUT, and EXCESS [N].
    integrates
        (N,), whether the integral goes on.
    memory
        (N, 3, 6), rows INTEGRAL, DISTURBANCE and EXPLAINED.
    reactions, carriers
        (N, 2, c, 6) and (N, c, 3, 6), see `reaction.react`.
    A, w, bounds
        Results, (N, 6, m), (N, 6) and (2, N, m).
    """
    bodies, cables, settings, mask = robot
    count, m = bodies.shape[0], cables.shape[0]
    state, wanted, momentum = np.zeros(BODY * count + CABLE_BLOCKS * m), np.zeros(6), np.zeros(6)
    missing = np.zeros(6)
    command = np.zeros(COMMANDS + m + CARRIER * count)
    on_bodies, on_cables = np.zeros((count, BODY_WORK)), np.zeros((m, CABLE_WORK))
    columns, gram = np.zeros((6 * reach.shape[0], 6)), np.zeros((6, 7))
    spare = np.zeros_like(on_bodies), np.zeros_like(on_cables), np.zeros((6, m)), np.zeros((count, 12)), np.zeros(6)
    at_reference = np.zeros_like(state), command, *spare
    for row in range(measured.shape[0]):
        write_bounds(limits, gains[CARRIERS, WINCHES], patience, dt, pulls[row], heard[row], bounds[:, row])
        usable = is_usable(measured[row], reference[row], pulls[row], t_ref[row], carriers[row])
        if usable and late.shape[0] > 0 and (since > 0.0 or dt == 0.0):
            put_measured(robot, late[row], state, command, on_bodies, on_cables, A[row])
            write_wrench(bodies, settings, state, wanted, late[row, 0], on_bodies, w[row], momentum)
            usable = is_finite(A[row])
            if usable:
                observe(settings, mask, gains, since, A[row], pulls[row, KNOWN], momentum, memory[row])
        if usable:
            put_measured(robot, measured[row], state, command, on_bodies, on_cables, A[row])
            usable = is_finite(A[row])
        if not usable:
            for k in range(6):
                w[row, k] = math.nan
            if reach.shape[0] > 0:
                add_offsets(reactions[row], carriers[row])
            continue
        for k in range(6):
            error = reference[row, k] - measured[row, 0, k]
            if k >= 3:
                error -= 2.0 * math.pi * math.floor(error / (2.0 * math.pi) + 0.5)
            if integrates[row]:
                memory[row, INTEGRAL, k] += dt * error
            wanted[k] = reference[row, 12 + k] + gains[KP, k] * error + gains[KI, k] * memory[row, INTEGRAL, k]
            wanted[k] += gains[KD, k] * (reference[row, 6 + k] - measured[row, 0, 6 + k])
        write_wrench(bodies, settings, state, wanted, measured[row, 0], on_bodies, w[row], momentum)
        if late.shape[0] == 0:
            observe(settings, mask, gains, since, A[row], pulls[row, KNOWN], momentum, memory[row])
        for k in range(6):
            w[row, k] = mask[k] * (w[row, k] - memory[row, DISTURBANCE, k])
        if reach.shape[0] > 0:
            if gains[CARRIERS, CORRECTS] == 1.0:
                for k in range(6):
                    missing[k] = w[row, k]
                    for i in range(m):
                        missing[k] -= A[row, k, i] * t_ref[row, i]
            else:
                planned_disturbance(robot, reference[row], carriers[row], t_ref[row], at_reference, missing)
                for k in range(6):
                    missing[k] = mask[k] * (missing[k] - memory[row, DISTURBANCE, k])
            react(
                settings, gains[CARRIERS], dt, reach, cables, on_cables, A[row], missing, t_ref[row], reactions[row],
                columns, gram, carriers[row],
            )  # fmt: skip


def put_measured(robot, measured, state, command, on_bodies, on_cables, A):
    """Put bodies and cables where they are measured, (1 + c, 12), and write the wrench matrix."""
    bodies, cables, settings, mask = robot
    for b in range(bodies.shape[0]):
        put_body(state, BODY * b, measured[b])
    place_bodies(bodies, command, state, state, on_bodies, cables.shape[0], 0.0)
    move_to_com(settings, state, on_bodies)
    run_cables(cables, state, on_bodies, on_cables, BODY * bodies.shape[0])
    write_wrench_matrix(mask, on_cables, A)


def planned_disturbance(robot, reference, carriers, t_ref, work, missing):
    """Write the wrench that the planned motion needs less the one of its tensions, (6,), or zeros without tensions.

    It is what the plan knows of wind, and what the tensions of a plan that has none in their limits miss.
    """
    bodies, _, settings, _ = robot
    state, command, on_bodies, on_cables, A, motions, momentum = work
    m, planned = A.shape[1], False
    for i in range(m):
        planned |= t_ref[i] != 0.0
    for k in range(6):
        missing[k] = 0.0
    if not planned:
        return
    for b in range(bodies.shape[0]):
        for k in range(6):
            motions[b, k] = reference[k] if b == 0 else carriers[b - 1, 0, k]
            motions[b, 6 + k] = reference[6 + k] if b == 0 else carriers[b - 1, 1, k]
    put_measured(robot, motions, state, command, on_bodies, on_cables, A)
    write_wrench(bodies, settings, state, reference[12:], reference, on_bodies, missing, momentum)
    for k in range(6):
        for i in range(m):
            missing[k] -= A[k, i] * t_ref[i]


def write_bounds(limits, slow, patience, dt, pulls, heard, bounds):
    """Write the bounds of a row's tensions, limits and rates, zero for cables that count as cut; and KNOWN tensions."""
    for i in range(limits.shape[1]):
        step, last, highest = limits[RATE_MAX, i] * dt, pulls[LAST, i], limits[HIGHEST, i]
        if abs(pulls[MEASURED, i]) <= LARGEST:
            little = max(limits[LOWEST, i], SOMETHING * highest)
            hear(dt / patience, pulls[MEASURED, i], pulls[THEN, i], little, highest, heard, i)
            know(slow * dt, pulls, heard, i)
        if heard[IS_CUT, i] == 1.0:
            bounds[0, i] = bounds[1, i] = 0.0
        elif dt > 0.0:
            bounds[0, i] = min(max(limits[LOWEST, i], last - step), highest)
            bounds[1, i] = max(min(highest, last + step), limits[LOWEST, i])
        else:
            bounds[0, i], bounds[1, i] = limits[LOWEST, i], highest


def hear(elapsed, reported, commanded, little, highest, heard, i):
    """Update what is heard of cable `i`, with the time since the last step in units of the patience."""
    share = min(-math.log(LITTLE) * elapsed, 0.25)  # a step after a long pause is no more than one report
    if elapsed > 0.0 and heard[COMMANDED, i] == 0.0:
        heard[REPORTED, i] = heard[COMMANDED, i] = commanded  # it is taken to pull when it is commanded first
    heard[REPORTED, i] += share * (reported - heard[REPORTED, i])
    if heard[IS_CUT, i] == 1.0:
        if heard[REPORTED, i] >= ENOUGH * little:
            heard[IS_CUT, i], heard[COMMANDED, i] = 0.0, heard[REPORTED, i]
    else:
        heard[COMMANDED, i] += share * (commanded - heard[COMMANDED, i])
        if heard[COMMANDED, i] >= SOMETHING * highest and heard[REPORTED, i] <= LITTLE * heard[COMMANDED, i]:
            heard[IS_CUT, i], heard[REPORTED, i] = 1.0, 0.0


def know(share, pulls, heard, i):
    """Write what the observers know of the tension of cable `i`: the report without its EXCESS from the command.

    They so follow a winch that is late, and find the force that a winch or a sensor takes away all the time. With the
    report as it is they would take this force for explained, and nothing would make up for it.
    """
    if heard[IS_CUT, i] == 1.0:
        heard[EXCESS, i] = 0.0
    else:
        heard[EXCESS, i] += min(share, 1.0) * (pulls[MEASURED, i] - pulls[THEN, i] - heard[EXCESS, i])
    pulls[KNOWN, i] = pulls[MEASURED, i] - heard[EXCESS, i]


def is_usable(measured, reference, pulls, t_ref, carriers):
    """Return whether all numbers of a row are finite and at most LARGEST."""
    usable = is_measured(measured, pulls)
    for k in range(18):
        usable &= abs(reference[k]) <= LARGEST
    for i in range(t_ref.shape[0]):
        usable &= abs(t_ref[i]) <= LARGEST
    for c in range(carriers.shape[0]):
        for k in range(6):
            for order in range(3):
                usable &= abs(carriers[c, order, k]) <= LARGEST
    return usable


def is_measured(measured, pulls):
    """Return whether all numbers that sensors report are finite and at most LARGEST."""
    usable = True
    for b in range(measured.shape[0]):
        for k in range(12):
            usable &= abs(measured[b, k]) <= LARGEST
    for i in range(pulls.shape[1]):
        usable &= abs(pulls[MEASURED, i]) <= LARGEST
    return usable


def is_finite(A):
    """Return whether all entries of a matrix are finite."""
    total = 0.0
    for k in range(6):
        for i in range(A.shape[1]):
            total += 0.0 * A[k, i]
    return total == 0.0


def observe(settings, mask, gains, dt, A, pull, momentum, memory):
    """Update the estimated disturbance, whose change since the last step A t + m g + d does not explain."""
    for k in range(6):
        known = 0.0
        if dt > 0.0:
            known = settings[TOTAL_MASS] * settings[GRAVITY + k] if k < 3 else 0.0
            for i in range(A.shape[1]):
                known += A[k, i] * pull[i]
            known += memory[DISTURBANCE, k]
        else:
            memory[EXPLAINED, k] = momentum[k]
        memory[EXPLAINED, k] += dt * known
        gain = gains[OBSERVER, k] if dt * gains[OBSERVER, k] < 1.0 else 1.0 / dt
        memory[DISTURBANCE, k] = mask[k] * gain * (momentum[k] - memory[EXPLAINED, k])


def move_to_com(settings, state, on_bodies):
    """Make the platform's block, written for its frame, that of its CoM."""
    cx, cy, cz = turned(on_bodies, settings[COM], settings[COM + 1], settings[COM + 2])
    ox, oy, oz = on_bodies[0, OMEGA], on_bodies[0, OMEGA + 1], on_bodies[0, OMEGA + 2]
    state[0] += cx
    state[1] += cy
    state[2] += cz
    state[VELOCITY] += oy * cz - oz * cy
    state[VELOCITY + 1] += oz * cx - ox * cz
    state[VELOCITY + 2] += ox * cy - oy * cx


def write_wrench_matrix(mask, on_cables, A):
    """Write the columns (u, r x u), with zeros where the platform has no freedom."""
    for i in range(A.shape[1]):
        ux, uy, uz = on_cables[i, U], on_cables[i, U + 1], on_cables[i, U + 2]
        rx, ry, rz = on_cables[i, ARM], on_cables[i, ARM + 1], on_cables[i, ARM + 2]
        A[0, i], A[1, i], A[2, i] = mask[0] * ux, mask[1] * uy, mask[2] * uz
        A[3, i] = mask[3] * (ry * uz - rz * uy)
        A[4, i] = mask[4] * (rz * ux - rx * uz)
        A[5, i] = mask[5] * (rx * uy - ry * ux)


def put_body(state, at, motion):
    """Write the block of a body, of its frame, from its pose and velocity (12,)."""
    for k in range(3):
        state[at + k], state[at + VELOCITY + k] = motion[k], motion[6 + k]
    set_quaternion(state, at + QUATERNION, motion[3], motion[4], motion[5])
    sr, cr, sp, cp = math.sin(motion[3]), math.cos(motion[3]), math.sin(motion[4]), math.cos(motion[4])
    state[at + RATE] = motion[9] - sp * motion[11]
    state[at + RATE + 1] = cr * motion[10] + sr * cp * motion[11]
    state[at + RATE + 2] = -sr * motion[10] + cr * cp * motion[11]


def turned(on_bodies, x, y, z):
    """Return a vector of the platform's frame in {G}."""
    return (
        on_bodies[0, 0] * x + on_bodies[0, 1] * y + on_bodies[0, 2] * z,
        on_bodies[0, 3] * x + on_bodies[0, 4] * y + on_bodies[0, 5] * z,
        on_bodies[0, 6] * x + on_bodies[0, 7] * y + on_bodies[0, 8] * z,
    )


def write_wrench(bodies, settings, state, wanted, motion, on_bodies, w, momentum):
    """Write the wrench of a wanted acceleration of the pose, and the momentum, both about the CoM in {G}."""
    roll, pitch, d_roll, d_pitch, d_yaw = motion[3], motion[4], motion[9], motion[10], motion[11]
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    p, q, r = state[RATE], state[RATE + 1], state[RATE + 2]
    ap = wanted[3] - sp * wanted[5] - cp * d_pitch * d_yaw
    aq = cr * wanted[4] - sr * d_roll * d_pitch + sr * cp * wanted[5]
    aq += (cr * cp * d_roll - sr * sp * d_pitch) * d_yaw
    ar = -sr * wanted[4] - cr * d_roll * d_pitch + cr * cp * wanted[5]
    ar -= (sr * cp * d_roll + cr * sp * d_pitch) * d_yaw
    J = bodies[0, INERTIA : INERTIA + 9]
    hx = J[0] * p + J[1] * q + J[2] * r
    hy = J[3] * p + J[4] * q + J[5] * r
    hz = J[6] * p + J[7] * q + J[8] * r
    nx = J[0] * ap + J[1] * aq + J[2] * ar + q * hz - r * hy
    ny = J[3] * ap + J[4] * aq + J[5] * ar + r * hx - p * hz
    nz = J[6] * ap + J[7] * aq + J[8] * ar + p * hy - q * hx
    w[3], w[4], w[5] = turned(on_bodies, nx, ny, nz)
    momentum[3], momentum[4], momentum[5] = turned(on_bodies, hx, hy, hz)
    # The CoM accelerates as the frame does, and by alpha x c + Omega x (Omega x c).
    cx, cy, cz = settings[COM], settings[COM + 1], settings[COM + 2]
    ux, uy, uz = q * cz - r * cy, r * cx - p * cz, p * cy - q * cx
    ax = aq * cz - ar * cy + q * uz - r * uy
    ay = ar * cx - ap * cz + r * ux - p * uz
    az = ap * cy - aq * cx + p * uy - q * ux
    ax, ay, az = turned(on_bodies, ax, ay, az)
    mass = settings[TOTAL_MASS]
    w[0] = mass * (wanted[0] + ax - settings[GRAVITY])
    w[1] = mass * (wanted[1] + ay - settings[GRAVITY + 1])
    w[2] = mass * (wanted[2] + az - settings[GRAVITY + 2])
    for k in range(3):
        momentum[k] = mass * state[VELOCITY + k]
