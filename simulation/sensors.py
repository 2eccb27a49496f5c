"""Kernel: poses, velocities and cable lengths of states of a plant, in the coordinates of the house."""

import math

import numpy as np

from ..plant.bodies import place_bodies
from ..plant.layout import BODY, BODY_WORK, CABLE_WORK, CARRIER, COMMANDS, L_RATE, OMEGA, RATE, VELOCITY, L
from ..plant.lines import run_cables


def sense_rows(bodies, cables, com, states, motions, lengths):
    """Write what perfect sensors measure.

    Parameters
    ----------
    bodies, cables
        Of the robot, in the columns of `layout`; each body is free.
    com
        (3,), of the platform in its frame [m].
    states
        (N, n), of the plant.
    motions, lengths
        Results: pose and velocity of platform and carriers, (N, 1 + c, 12), and lengths of the cables and their rates,
        (N, 2, m).
    """
    count, m = bodies.shape[0], cables.shape[0]
    places = BODY * count
    state, command = np.zeros(states.shape[1]), np.zeros(COMMANDS + m + CARRIER * count)
    on_bodies, on_cables = np.zeros((count, BODY_WORK)), np.zeros((m, CABLE_WORK))
    for row in range(states.shape[0]):
        for j in range(len(state)):
            state[j] = states[row, j]
        place_bodies(bodies, command, state, state, on_bodies, m, 0.0)
        run_cables(cables, state, on_bodies, on_cables, places)
        for i in range(m):
            lengths[row, 0, i], lengths[row, 1, i] = on_cables[i, L], on_cables[i, L_RATE]
        for b in range(count):
            write_motion(on_bodies[b], state, BODY * b, motions[row, b])
        R = on_bodies[0]
        ox, oy, oz = R[OMEGA], R[OMEGA + 1], R[OMEGA + 2]
        cx = R[0] * com[0] + R[1] * com[1] + R[2] * com[2]
        cy = R[3] * com[0] + R[4] * com[1] + R[5] * com[2]
        cz = R[6] * com[0] + R[7] * com[1] + R[8] * com[2]
        motions[row, 0, 0] -= cx
        motions[row, 0, 1] -= cy
        motions[row, 0, 2] -= cz
        motions[row, 0, 6] -= oy * cz - oz * cy
        motions[row, 0, 7] -= oz * cx - ox * cz
        motions[row, 0, 8] -= ox * cy - oy * cx


def write_motion(R, state, at, motion):
    """Write position, Euler angles and their derivatives; at a pitch of 90 degrees those of roll and yaw are nan."""
    for k in range(3):
        motion[k], motion[6 + k] = state[at + k], state[at + VELOCITY + k]
    cp = math.sqrt(R[7] * R[7] + R[8] * R[8])
    motion[3], motion[4] = math.atan2(R[7], R[8]), math.atan2(-R[6], cp)
    p, q, r = state[at + RATE], state[at + RATE + 1], state[at + RATE + 2]
    sr, cr = math.sin(motion[3]), math.cos(motion[3])
    # The yaw that belongs to this roll: at a pitch of 90 degrees both are rounding, and only together an attitude.
    motion[5] = math.atan2(sr * R[2] - cr * R[1], cr * R[4] - sr * R[5])
    across = (sr * q + cr * r) / cp if cp > 0.0 else math.nan
    motion[9], motion[10], motion[11] = p - R[6] * across, cr * q - sr * r, across
