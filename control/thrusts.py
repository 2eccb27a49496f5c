"""Kernel: what the actuators of flying carriers do, so that these go where they are ordered with their cables' pull.

    F   = m (a + 2 k (v - v_q) + k^2 (p - p_q) - g) + sum of t u - d
    tau = J (alpha + 2 h (Omega - Omega_q) + h^2 e) + Omega_q x J Omega_q - M

    d   = K (m v_q - m v_0 - integral of (T + m g - sum of t u + d))

F is the wanted thrust in {G}, T the one given, d the estimate of all other forces (air, a mass that is not as in the
robot file), e the rotation from the thrust's axis to F and to the ordered yaw, M the moment of the
cables about the CoM, k and h the bandwidths of place and attitude; q marks what is measured. Only the part of F along
the thrust's axis is there at once; the rest comes when the carrier has turned. Source: T. Lee, M. Leok and N. H.
McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC 2010, to first order in e.
"""

import math

import numpy as np

from ..plant.bodies import place_bodies
from ..plant.layout import (
    BODY,
    BODY_WORK,
    CABLE_BLOCKS,
    CABLE_WORK,
    CARRIER,
    CARRIER_ARM,
    COMMANDS,
    GRAVITY,
    INERTIA,
    MASS,
    OWNER,
    RATE,
    U,
)
from ..plant.lines import run_cables
from .mechanics import KNOWN, is_measured, move_to_com, put_body

# Rows of `memory`: the estimated force, momentum less what the estimate explains, and, in the carrier's axes, the
# angular acceleration that is ordered and the rate that is measured.
OTHER, ACCOUNTED, TURN, TURNS, OTHERS = 0, 1, 2, 3, 4


def write_thrusts(robot, gains, inverses, forces, dt, measured, carriers, tensions, pulls, given, memory, actuation):
    """Write the commands of all actuators.

    Parameters
    ----------
    robot
        As for `mechanics.write_rows`.
    gains
        (N, 3), bandwidths of place, attitude and the estimate of d [rad/s].
    inverses
        (c, a, 6), commands of the actuators for a force and a moment in the carrier's axes; zeros for carriers without.
    forces
        (c, a, 3), of the actuators in the carrier's axes, for units of their commands [N].
    dt
        Time since the last step [s], 0 in the first one.
    measured
        (N, 1 + c, 12), pose and velocity of the platform and of each carrier.
    carriers
        (N, c, 3, 6), pose, velocity and acceleration that they should have.
    tensions
        (N, m) [N], as commanded.
    pulls
        (N, 4, m), whose row KNOWN has the tensions since the last step [N].
    given
        (N, c, a), the actuators' commands since then.
    memory
        (N, c, 4, 3), rows OTHER, ACCOUNTED, TURN and TURNS.
    actuation
        Result, (N, c, a).
    """
    bodies, cables, settings, _ = robot
    count, m = bodies.shape[0], cables.shape[0]
    places = BODY * count
    state, command = np.zeros(places + CABLE_BLOCKS * m), np.zeros(COMMANDS + m + CARRIER * count)
    on_bodies, on_cables = np.zeros((count, BODY_WORK)), np.zeros((m, CABLE_WORK))
    wrench = np.zeros(6)
    for row in range(measured.shape[0]):
        for b in range(count):
            put_body(state, BODY * b, measured[row, b])
        place_bodies(bodies, command, state, state, on_bodies, m, 0.0)
        move_to_com(settings, state, on_bodies)
        run_cables(cables, state, on_bodies, on_cables, places)
        for c in range(count - 1):
            if np.any(inverses[c] != 0.0):
                if is_measured(measured[row], pulls[row]):
                    observe_carrier(
                        bodies[1 + c, MASS], settings, gains[row, 2], dt, on_bodies[1 + c], on_cables, cables, c,
                        measured[row, 1 + c], pulls[row, KNOWN], forces[c], given[row, c], memory[row, c],
                    )  # fmt: skip
                wrench_of_carrier(
                    bodies[1 + c], settings, gains[row], state, BODY * (1 + c), on_bodies[1 + c], cables, on_cables, c,
                    measured[row, 1 + c], carriers[row, c], tensions[row], memory[row, c], wrench,
                )  # fmt: skip
                for a in range(inverses.shape[1]):
                    actuation[row, c, a] = 0.0
                    for k in range(6):
                        actuation[row, c, a] += inverses[c, a, k] * wrench[k]


def observe_carrier(mass, settings, gain, dt, R, on_cables, cables, carrier, motion, pull, forces, given, memory):
    """Update the estimate of the force on a carrier that thrust, weight and cables do not explain."""
    gain = gain if dt * gain < 1.0 else 1.0 / dt
    for k in range(3):
        if dt > 0.0:
            known = mass * settings[GRAVITY + k] + memory[OTHER, k]
            for a in range(forces.shape[0]):
                force = R[3 * k] * forces[a, 0] + R[3 * k + 1] * forces[a, 1] + R[3 * k + 2] * forces[a, 2]
                known += given[a] * force
            for i in range(cables.shape[0]):
                if int(cables[i, OWNER]) == carrier + 1:
                    known -= pull[i] * on_cables[i, U + k]
            memory[ACCOUNTED, k] += dt * known
        else:
            memory[ACCOUNTED, k] = mass * motion[6 + k]
        memory[OTHER, k] = gain * (mass * motion[6 + k] - memory[ACCOUNTED, k])


def wrench_of_carrier(
    body, settings, gains, state, at, R, cables, on_cables, carrier, motion, wanted, tensions, memory, wrench
):
    """Write the force and the moment that a carrier needs of its actuators, in its own axes."""
    place, turn, mass = gains[0], gains[1], body[MASS]
    fx = mass * (wanted[2, 0] + place * (2.0 * (wanted[1, 0] - motion[6]) + place * (wanted[0, 0] - motion[0])))
    fy = mass * (wanted[2, 1] + place * (2.0 * (wanted[1, 1] - motion[7]) + place * (wanted[0, 1] - motion[1])))
    fz = mass * (wanted[2, 2] + place * (2.0 * (wanted[1, 2] - motion[8]) + place * (wanted[0, 2] - motion[2])))
    fx -= mass * settings[GRAVITY] + memory[OTHER, 0]
    fy -= mass * settings[GRAVITY + 1] + memory[OTHER, 1]
    fz -= mass * settings[GRAVITY + 2] + memory[OTHER, 2]
    mx = my = mz = 0.0
    for i in range(cables.shape[0]):
        if int(cables[i, OWNER]) == carrier + 1:
            tx, ty, tz = (
                tensions[i] * on_cables[i, U],
                tensions[i] * on_cables[i, U + 1],
                tensions[i] * on_cables[i, U + 2],
            )
            dx, dy, dz = on_cables[i, CARRIER_ARM], on_cables[i, CARRIER_ARM + 1], on_cables[i, CARRIER_ARM + 2]
            fx += tx
            fy += ty
            fz += tz
            mx -= dy * tz - dz * ty
            my -= dz * tx - dx * tz
            mz -= dx * ty - dy * tx
    size = max(math.sqrt(fx * fx + fy * fy + fz * fz), 1e-9)
    zx, zy, zz = R[2], R[5], R[8]
    # From the thrust's axis to F, in {G}; beyond a right angle as far as at one.
    ex, ey, ez = (zy * fz - zz * fy) / size, (zz * fx - zx * fz) / size, (zx * fy - zy * fx) / size
    if zx * fx + zy * fy + zz * fz < 0.0:
        sine = max(math.sqrt(ex * ex + ey * ey + ez * ez), 1e-9)
        ex, ey, ez = ex / sine, ey / sine, ez / sine
    yaw = wanted[0, 5] - motion[5]
    yaw -= 2.0 * math.pi * math.floor(yaw / (2.0 * math.pi) + 0.5)
    gap = (
        R[0] * ex + R[3] * ey + R[6] * ez,
        R[1] * ex + R[4] * ey + R[7] * ez,
        R[2] * ex + R[5] * ey + R[8] * ez + yaw * zz,
    )
    sr, cr = math.sin(motion[3]), math.cos(motion[3])
    sp, cp = math.sin(motion[4]), math.cos(motion[4])
    d_roll, d_pitch, d_yaw = wanted[1, 3], wanted[1, 4], wanted[1, 5]
    p, q, r = state[at + RATE], state[at + RATE + 1], state[at + RATE + 2]
    dd_roll, dd_pitch, dd_yaw = wanted[2, 3], wanted[2, 4], wanted[2, 5]
    ap = turn * (turn * gap[0] + 2.0 * (d_roll - sp * d_yaw - p)) + dd_roll - sp * dd_yaw
    aq = turn * (turn * gap[1] + 2.0 * (cr * d_pitch + sr * cp * d_yaw - q)) + cr * dd_pitch + sr * cp * dd_yaw
    ar = turn * (turn * gap[2] + 2.0 * (cr * cp * d_yaw - sr * d_pitch - r)) + cr * cp * dd_yaw - sr * dd_pitch
    memory[TURN, 0], memory[TURN, 1], memory[TURN, 2] = ap, aq, ar
    memory[TURNS, 0], memory[TURNS, 1], memory[TURNS, 2] = p, q, r
    J = body[INERTIA : INERTIA + 9]
    hx, hy, hz = J[0] * p + J[1] * q + J[2] * r, J[3] * p + J[4] * q + J[5] * r, J[6] * p + J[7] * q + J[8] * r
    wrench[0] = wrench[1] = 0.0
    wrench[2] = fx * zx + fy * zy + fz * zz
    wrench[3] = J[0] * ap + J[1] * aq + J[2] * ar + q * hz - r * hy - (R[0] * mx + R[3] * my + R[6] * mz)
    wrench[4] = J[3] * ap + J[4] * aq + J[5] * ar + r * hx - p * hz - (R[1] * mx + R[4] * my + R[7] * mz)
    wrench[5] = J[6] * ap + J[7] * aq + J[8] * ar + p * hy - q * hx - (R[2] * mx + R[5] * my + R[8] * mz)
