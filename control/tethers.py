"""Kernel: carriers that cables of fixed length hold, each one cable, in two coordinates of the cable's direction.

    anchor = attachment + Rz(yaw) (a e1 + b e2 + sqrt(l^2 - a^2 - b^2) n)

with the yaw of the platform, so that a team turns with its load, and axes e1, e2, n of which n is the direction at home
and the others are across it. Derivatives over time are quotients of differences along p + s v + s^2 a / 2.
"""

import math

import numpy as np

from ..models.plant.bodies import place_bodies
from ..models.plant.layout import (
    ANCHOR,
    ATTACHMENT,
    BODY,
    BODY_WORK,
    CABLE_BLOCKS,
    CARRIER,
    COMMANDS,
    OWNER,
)
from .mechanics import move_to_com, put_body

# Columns of `tethers`: number of the cable, its length, and the axes e1, e2 and n.
CABLE, LENGTH, AXES, TETHER_COLUMNS = 0, 1, 2, 11
FARTHEST = 0.95  # of the length: beyond, a direction is taken to be there
STEP_OF_TIME = 1e-3  # [s], of a difference quotient


def put_tethered(tethers, cables, state, on_bodies, places):
    """Put carriers where coordinates, (2 k,) [m], of their cables have them; rotations are those of `on_bodies`."""
    yaw = math.atan2(on_bodies[0, 3], on_bodies[0, 0])
    cy, sy = math.cos(yaw), math.sin(yaw)
    for k in range(tethers.shape[0]):
        i = int(tethers[k, CABLE])
        c, length = int(cables[i, OWNER]), tethers[k, LENGTH]
        a, b = places[2 * k], places[2 * k + 1]
        far = math.sqrt(a * a + b * b)
        if far > FARTHEST * length:
            a, b, far = a * FARTHEST * length / far, b * FARTHEST * length / far, FARTHEST * length
        along = math.sqrt(length * length - far * far)
        axes = tethers[k, AXES:]
        x = a * axes[0] + b * axes[3] + along * axes[6]
        y = a * axes[1] + b * axes[4] + along * axes[7]
        z = a * axes[2] + b * axes[5] + along * axes[8]
        R, P, at = on_bodies[0], on_bodies[c], BODY * c
        bx, by, bz = cables[i, ATTACHMENT], cables[i, ATTACHMENT + 1], cables[i, ATTACHMENT + 2]
        ax, ay, az = cables[i, ANCHOR], cables[i, ANCHOR + 1], cables[i, ANCHOR + 2]
        state[at] = state[0] + R[0] * bx + R[1] * by + R[2] * bz + cy * x - sy * y
        state[at + 1] = state[1] + R[3] * bx + R[4] * by + R[5] * bz + sy * x + cy * y
        state[at + 2] = state[2] + R[6] * bx + R[7] * by + R[8] * bz + z
        state[at] -= P[0] * ax + P[1] * ay + P[2] * az
        state[at + 1] -= P[3] * ax + P[4] * ay + P[5] * az
        state[at + 2] -= P[6] * ax + P[7] * ay + P[8] * az


def write_directions(robot, tethers, motions, directions):
    """Write coordinates of the cables' directions, and their two derivatives over time.

    Parameters
    ----------
    robot
        As for `mechanics.write_rows`.
    tethers
        (k, TETHER_COLUMNS).
    motions
        (N, 1 + c, 18), pose, velocity and acceleration of platform and carriers.
    directions
        Result, (N, 3, 2 k) [m, m/s, m/s^2].
    """
    bodies, cables, settings, _ = robot
    count, m, h = bodies.shape[0], cables.shape[0], STEP_OF_TIME
    state, on_bodies = np.zeros(BODY * count + CABLE_BLOCKS * m), np.zeros((count, BODY_WORK))
    command, motion = np.zeros(COMMANDS + m + CARRIER * count), np.zeros((count, 12))
    found = np.zeros((3, 2 * tethers.shape[0]))
    for row in range(motions.shape[0]):
        for s in range(3):
            time = (s - 1) * h
            for b in range(count):
                for j in range(6):
                    motion[b, j] = motions[row, b, j] + time * (
                        motions[row, b, 6 + j] + time / 2 * motions[row, b, 12 + j]
                    )
                put_body(state, BODY * b, motion[b])
            place_bodies(bodies, command, state, state, on_bodies, m, 0.0)
            move_to_com(settings, state, on_bodies)
            find_directions(tethers, cables, state, on_bodies, found[s])
        for j in range(found.shape[1]):
            directions[row, 0, j] = found[1, j]
            directions[row, 1, j] = (found[2, j] - found[0, j]) / (2.0 * h)
            directions[row, 2, j] = (found[2, j] - 2.0 * found[1, j] + found[0, j]) / (h * h)


def find_directions(tethers, cables, state, on_bodies, places):
    """Write the coordinates, (2 k,), of carriers as they are placed; the inverse of `put_tethered`."""
    yaw = math.atan2(on_bodies[0, 3], on_bodies[0, 0])
    cy, sy = math.cos(yaw), math.sin(yaw)
    for k in range(tethers.shape[0]):
        i = int(tethers[k, CABLE])
        c = int(cables[i, OWNER])
        R, P, at, axes = on_bodies[0], on_bodies[c], BODY * c, tethers[k, AXES:]
        bx, by, bz = cables[i, ATTACHMENT], cables[i, ATTACHMENT + 1], cables[i, ATTACHMENT + 2]
        ax, ay, az = cables[i, ANCHOR], cables[i, ANCHOR + 1], cables[i, ANCHOR + 2]
        x = state[at] - state[0] + P[0] * ax + P[1] * ay + P[2] * az - (R[0] * bx + R[1] * by + R[2] * bz)
        y = state[at + 1] - state[1] + P[3] * ax + P[4] * ay + P[5] * az - (R[3] * bx + R[4] * by + R[5] * bz)
        z = state[at + 2] - state[2] + P[6] * ax + P[7] * ay + P[8] * az - (R[6] * bx + R[7] * by + R[8] * bz)
        x, y = cy * x + sy * y, cy * y - sy * x
        places[2 * k] = axes[0] * x + axes[1] * y + axes[2] * z
        places[2 * k + 1] = axes[3] * x + axes[4] * y + axes[5] * z


def write_carriers(robot, tethers, motion, carriers):
    """Write how carriers move if platform and directions do.

    Parameters
    ----------
    robot, tethers
        As for `write_directions`.
    motion
        (3, 6 + 2 k), pose of the platform and the coordinates of directions, and their two derivatives over time.
    carriers
        Result, (c, 3, 6): their positions and two derivatives over time; attitudes are read, and stay.
    """
    bodies, cables, settings, _ = robot
    count, m, h = bodies.shape[0], cables.shape[0], STEP_OF_TIME
    state, on_bodies = np.zeros(BODY * count + CABLE_BLOCKS * m), np.zeros((count, BODY_WORK))
    command, pose = np.zeros(COMMANDS + m + CARRIER * count), np.zeros(12)
    places, found = np.zeros(2 * tethers.shape[0]), np.zeros((3, 3 * count))
    for s in range(3):
        time = (s - 1) * h
        for b in range(count):
            for j in range(6):
                if b == 0:
                    pose[j] = motion[0, j] + time * (motion[1, j] + time / 2 * motion[2, j])
                else:
                    pose[j] = carriers[b - 1, 0, j] + time * (carriers[b - 1, 1, j] + time / 2 * carriers[b - 1, 2, j])
            put_body(state, BODY * b, pose)
        place_bodies(bodies, command, state, state, on_bodies, m, 0.0)
        move_to_com(settings, state, on_bodies)
        for j in range(places.shape[0]):
            places[j] = motion[0, 6 + j] + time * (motion[1, 6 + j] + time / 2 * motion[2, 6 + j])
        put_tethered(tethers, cables, state, on_bodies, places)
        for b in range(1, count):
            for j in range(3):
                found[s, 3 * b + j] = state[BODY * b + j]
    for k in range(tethers.shape[0]):
        c = int(cables[int(tethers[k, CABLE]), OWNER])
        for j in range(3):
            before, now, after = found[0, 3 * c + j], found[1, 3 * c + j], found[2, 3 * c + j]
            carriers[c - 1, 0, j] = now
            carriers[c - 1, 1, j] = (after - before) / (2.0 * h)
            carriers[c - 1, 2, j] = (after - 2.0 * now + before) / (h * h)
