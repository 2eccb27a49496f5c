"""Kernel: states of now, from states that were measured earlier and the tensions that were commanded since."""

import numpy as np

from ..plant.layout import BODY, BODY_WORK, CABLE_BLOCKS, CABLE_WORK, CARRIER, COMMANDS
from .prediction import VECTORS, put_robot, solve_columns, write_equations


def move_on(robot, dt, disturbance, tensions, accelerations, measured):
    """Move states on by the platform's equations and by constant accelerations of carriers.

    Parameters
    ----------
    robot
        As for `mechanics.write_rows`.
    dt
        Duration of each part of the time since [s].
    disturbance
        (N, 6), force [N] and moment about the CoM [N m] on the platform.
    tensions
        (k, N, m), in each part [N].
    accelerations
        Of carriers, (N, c, 6) [m/s^2, rad/s^2].
    measured
        (N, 1 + c, 12), pose and velocity of the platform and of each carrier, which become those of now. Where they
        are not finite, they stay so.
    """
    bodies, cables, _, _ = robot
    count, m = bodies.shape[0], cables.shape[0]
    state = np.zeros(BODY * count + CABLE_BLOCKS * m)
    command = np.zeros(COMMANDS + m + CARRIER * count)
    on_bodies, on_cables = np.zeros((count, BODY_WORK)), np.zeros((m, CABLE_WORK))
    motion, matrix, vectors = np.zeros((count, 12)), np.zeros((6, m)), np.zeros((VECTORS, 6))
    at = (state, command, on_bodies, on_cables, motion, matrix, vectors)
    freed, tethers = np.zeros((0, 2), dtype=np.int64), np.zeros((0, 1))
    solved = np.zeros((6, 13 + m))
    for row in range(measured.shape[0]):
        for k in range(tensions.shape[0]):
            put_robot(robot, freed, tethers, measured[row, 1:], measured[row, 0], at)
            write_equations(robot, disturbance[row], tensions[k, row], at, solved)
            solve_columns(solved)
            for b in range(count):
                for i in range(6):
                    faster = dt * (solved[i, 6] if b == 0 else accelerations[row, b - 1, i])
                    measured[row, b, i] += dt * (measured[row, b, 6 + i] + 0.5 * faster)
                    measured[row, b, 6 + i] += faster
