"""Kernel: the robot's motion over the stages of a predictive controller, to first order about a guess.

A state is (pose, its rate, and place and rate of each coordinate in which a carrier may leave its reference, or that
cables of fixed length leave it), a control (tensions, accelerations of those coordinates). With the tensions t,
the disturbance d and H ddx + h = w(x, dx, ddx),

    ddx = H^-1 (A(x) t + d - h(x, dx))

which is constant during a stage, so that x moves by dt dx + dt^2 ddx / 2. Its derivatives are H^-1 times those of
A(x) t - w(x, dx, ddx) with ddx as it is, which are quotients of differences.
"""

import numpy as np

from ..plant.bodies import place_bodies
from ..plant.layout import BODY, BODY_WORK, CABLE_BLOCKS, CABLE_WORK, CARRIER, COMMANDS
from ..plant.lines import run_cables
from .fixed_length_carriers import coordinates_of, put_tethered
from .mechanics import move_to_com, put_body, write_wrench, write_wrench_matrix

STEP = 1e-6  # [m, rad, rad/s], of a difference quotient
# Rows of `vectors`: unit acceleration, wrench and momentum, and the wrench without acceleration.
UNIT, TRIED, MOMENTUM, BIAS, VECTORS = 0, 1, 2, 3, 4


def write_stages(robot, freed, tethers, dt, disturbance, carriers, states, controls, A, B, c):
    """Write the dynamics x_(k+1) = A x_k + B u_k + c of all stages.

    Parameters
    ----------
    robot
        As for `mechanics.write_rows`.
    freed
        (f, 2), carrier and coordinate of each that may leave the reference.
    tethers
        (k, TETHER_COLUMNS), carriers that cables of fixed length hold, whose coordinates follow those; or none.
    dt
        Duration of each stage, (N,) [s].
    disturbance
        (6,), force [N] and moment about the CoM [N m] on the platform.
    carriers
        (N + 1, c, 12), pose and velocity of the carriers in the reference.
    states, controls
        (N + 1, n) and (N, u), the guess.
    A, B, c
        Results, (N, n, n), (N, n, u) and (N, n).
    """
    bodies, cables, settings, mask = robot
    count, m, free = bodies.shape[0], cables.shape[0], freed.shape[0] + coordinates_of(tethers)
    state = np.zeros(BODY * count + CABLE_BLOCKS * m)
    command = np.zeros(COMMANDS + m + CARRIER * count)
    on_bodies, on_cables = np.zeros((count, BODY_WORK)), np.zeros((m, CABLE_WORK))
    motion, matrix, vectors = np.zeros((count, 12)), np.zeros((6, m)), np.zeros((VECTORS, 6))
    at = (state, command, on_bodies, on_cables, motion, matrix, vectors)
    x, gains = np.zeros(12 + 2 * free), np.zeros((6, 12 + free))
    solved, acceleration = np.zeros((6, 13 + m)), np.zeros(6)
    needed, missed, changed = np.zeros(6), np.zeros(6), np.zeros(6)
    for k in range(controls.shape[0]):
        for j in range(12 + 2 * free):
            x[j] = states[k, j]
        put_robot(robot, freed, tethers, carriers[k], x, at)
        write_equations(robot, disturbance, controls[k], at, solved)
        solve_columns(solved)
        for i in range(6):
            acceleration[i] = solved[i, 6]
        write_wrench(bodies, settings, state, acceleration, motion[0], on_bodies, needed, vectors[MOMENTUM])
        write_missed(mask, matrix, controls[k], needed, missed)
        for j in range(12 + free):
            for i in range(6):
                gains[i, j] = 0.0
            # Neither velocities nor the coordinates that the platform does not have change accelerations, nor do
            # places where all carriers move along.
            if (j < 12 and mask[j % 6] == 0.0) or 6 <= j < 9 or (j < 3 and tethers.shape[0] > 0):
                continue
            x[j] += STEP
            put_robot(robot, freed, tethers, carriers[k], x, at)
            x[j] = states[k, j]
            tried = needed  # which places alone do not change
            if 3 <= j < 12:
                tried = vectors[TRIED]
                write_wrench(bodies, settings, state, acceleration, motion[0], on_bodies, tried, vectors[MOMENTUM])
            write_missed(mask, matrix, controls[k], tried, changed)
            for i in range(6):
                for other in range(6):
                    gains[i, j] += solved[i, 7 + m + other] * (changed[other] - missed[other]) / STEP
        write_stage(solved, gains, m, free, dt[k], states[k], controls[k], A[k], B[k], c[k])


def put_robot(robot, freed, tethers, carriers, x, at):
    """Put bodies and cables where a state (n,) has them, and write the wrench matrix."""
    bodies, cables, settings, mask = robot
    state, command, on_bodies, on_cables, motion, matrix, _ = at
    m, free = cables.shape[0], freed.shape[0] + coordinates_of(tethers)
    for j in range(12):
        motion[0, j] = x[j]
    for b in range(1, bodies.shape[0]):
        for j in range(12):
            motion[b, j] = carriers[b - 1, j]
    for f in range(freed.shape[0]):
        motion[1 + freed[f, 0], freed[f, 1]] = x[12 + f]
        motion[1 + freed[f, 0], 6 + freed[f, 1]] = x[12 + free + f]
    for b in range(bodies.shape[0]):
        put_body(state, BODY * b, motion[b])
    place_bodies(bodies, command, state, state, on_bodies, m, 0.0)
    move_to_com(settings, state, on_bodies)
    put_tethered(tethers, cables, state, on_bodies, x[12 + freed.shape[0] :])
    run_cables(cables, state, on_bodies, on_cables, BODY * bodies.shape[0])
    write_wrench_matrix(mask, on_cables, matrix)


def write_equations(robot, disturbance, control, at, equations):
    """Write H, with ones where the platform has no freedom, and right of it A t + d - h, A and the unit matrix."""
    bodies, _, settings, mask = robot
    state, _, on_bodies, _, motion, matrix, vectors = at
    unit, tried, bias = vectors[UNIT], vectors[TRIED], vectors[BIAS]
    m = matrix.shape[1]
    write_wrench(bodies, settings, state, unit, motion[0], on_bodies, bias, vectors[MOMENTUM])
    for j in range(6):
        unit[j] = 1.0
        write_wrench(bodies, settings, state, unit, motion[0], on_bodies, tried, vectors[MOMENTUM])
        unit[j] = 0.0
        for i in range(6):
            equations[i, j] = mask[i] * mask[j] * (tried[i] - bias[i])
            equations[i, 7 + m + j] = 0.0
        equations[j, j] += 1.0 - mask[j]
        equations[j, 7 + m + j] = 1.0
    for i in range(6):
        equations[i, 6] = mask[i] * (disturbance[i] - bias[i])
        for j in range(m):
            equations[i, 6] += matrix[i, j] * control[j]
            equations[i, 7 + j] = matrix[i, j]


def write_missed(mask, matrix, control, needed, missed):
    """Write what tensions give of a wrench that is needed, less that wrench."""
    for i in range(6):
        missed[i] = -mask[i] * needed[i]
        for j in range(matrix.shape[1]):
            missed[i] += matrix[i, j] * control[j]


def solve_columns(equations):
    """Replace the columns after the sixth of (6, 6 + k) by the solutions, by elimination with pivots of each column."""
    columns = equations.shape[1]
    for j in range(6):
        best = j
        for i in range(j + 1, 6):
            if abs(equations[i, j]) > abs(equations[best, j]):
                best = i
        if best != j:
            for k in range(j, columns):
                equations[j, k], equations[best, k] = equations[best, k], equations[j, k]
        inverse = 1.0 / equations[j, j]
        for k in range(j, columns):
            equations[j, k] *= inverse
        for i in range(6):
            factor = equations[i, j]
            if i != j and factor != 0.0:
                for k in range(j, columns):
                    equations[i, k] -= factor * equations[j, k]


def write_stage(solved, gains, m, free, dt, x, u, A, B, c):
    """Write A, B and c of a stage from the acceleration at the guess, in column 6, and its derivatives."""
    half = 0.5 * dt * dt
    for i in range(6):
        rest = solved[i, 6]
        for j in range(12 + free):
            A[i, j], A[6 + i, j] = half * gains[i, j], dt * gains[i, j]
            rest -= gains[i, j] * x[j]
        A[i, i] += 1.0
        A[i, 6 + i] += dt
        A[6 + i, 6 + i] += 1.0
        for j in range(m):
            B[i, j], B[6 + i, j] = half * solved[i, 7 + j], dt * solved[i, 7 + j]
            rest -= solved[i, 7 + j] * u[j]
        c[i], c[6 + i] = half * rest, dt * rest
    for f in range(free):
        place, rate = 12 + f, 12 + free + f
        A[place, place], A[place, rate], A[rate, rate] = 1.0, dt, 1.0
        B[place, m + f], B[rate, m + f] = half, dt
        c[place] = c[rate] = 0.0
