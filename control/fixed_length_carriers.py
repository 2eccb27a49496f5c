"""Kernel: carriers that one, two or three cables of fixed length hold, in the coordinates that these leave them.

    place = mean of the attachments + Rz(yaw) (y1 e1 + y2 e2 + y3 e3)

with the yaw of the platform, so that a team turns with its load. Of a carrier with k cables the first 3 - k of y are
coordinates, across the directions in which the cables hold it at home; the lengths determine the others, by Newton's
method. Derivatives over time are quotients of differences along p + s v + s^2 a / 2.
"""

import math

import numpy as np

from ..plant.bodies import place_bodies
from ..plant.layout import ANCHOR, ATTACHMENT, BODY, BODY_WORK, CABLE_BLOCKS, CARRIER, COMMANDS
from .mechanics import move_to_com, put_body

# Columns of `tethers`: number of the carrier, how many cables it has, which ones, their lengths, y at home, how far
# coordinates may be from zero, and the axes e1, e2 and e3.
HELD, CABLES, WHICH, LENGTHS_OF, AT_HOME, FARTHEST, AXES, TETHER_COLUMNS = 0, 1, 2, 5, 8, 11, 12, 21
ROUNDS, EXACT = 20, 1e-14  # of Newton's method, and the change relative to the length at which it ends
STEP_OF_TIME = 1e-3  # [s], of a difference quotient


def coordinates_of(tethers):
    """Return how many coordinates there are."""
    total = 0
    for k in range(tethers.shape[0]):
        total += 3 - int(tethers[k, CABLES])
    return total


def heading(R):
    """Return cosine and sine of the yaw of a rotation matrix; of one that has none, those of zero."""
    size = math.sqrt(R[0] * R[0] + R[3] * R[3])
    return (R[0] / size, R[3] / size) if size > 1e-12 else (1.0, 0.0)


def put_tethered(tethers, cables, state, on_bodies, places):
    """Put carriers where their coordinates (f,) [m] have them; rotations are those of `on_bodies`."""
    R = on_bodies[0]
    cy, sy = heading(R)
    first = 0
    for k in range(tethers.shape[0]):
        row = tethers[k]
        held, at = int(row[CABLES]), BODY * (1 + int(row[HELD]))
        free = 3 - held
        px, py, pz = 0.0, 0.0, 0.0
        y0, y1, y2 = row[AT_HOME], row[AT_HOME + 1], row[AT_HOME + 2]
        far = 0.0
        if free >= 1:
            y0 = places[first]
            far = abs(y0)
        if free == 2:
            y1 = places[first + 1]
            far = math.sqrt(y0 * y0 + y1 * y1)
        if far > row[FARTHEST]:
            y0 *= row[FARTHEST] / far
            y1 *= row[FARTHEST] / far if free == 2 else 1.0
        if free == 2:
            y2 = math.copysign(math.sqrt(row[LENGTHS_OF] * row[LENGTHS_OF] - y0 * y0 - y1 * y1), y2)
        first += free
        mx, my, mz = middle_of(row, cables, R)
        for _ in range(ROUNDS):
            x, y = row[AXES] * y0 + row[AXES + 3] * y1 + row[AXES + 6] * y2, row[AXES + 1] * y0
            y += row[AXES + 4] * y1 + row[AXES + 7] * y2
            px, py = state[0] + mx + cy * x - sy * y, state[1] + my + sy * x + cy * y
            pz = state[2] + mz + row[AXES + 2] * y0 + row[AXES + 5] * y1 + row[AXES + 8] * y2
            d0, d1, d2 = correction(row, cables, state, on_bodies, px, py, pz, cy, sy)
            y0, y1, y2 = y0 + d0, y1 + d1, y2 + d2
            if abs(d0) + abs(d1) + abs(d2) <= EXACT * row[LENGTHS_OF]:
                break
        state[at], state[at + 1], state[at + 2] = px, py, pz


def middle_of(row, cables, R):
    """Return the mean of the attachments of a carrier's cables, from the platform's CoM in {G}."""
    x, y, z = 0.0, 0.0, 0.0
    for j in range(int(row[CABLES])):
        i = int(row[WHICH + j])
        bx, by, bz = cables[i, ATTACHMENT], cables[i, ATTACHMENT + 1], cables[i, ATTACHMENT + 2]
        x += (R[0] * bx + R[1] * by + R[2] * bz) / row[CABLES]
        y += (R[3] * bx + R[4] * by + R[5] * bz) / row[CABLES]
        z += (R[6] * bx + R[7] * by + R[8] * bz) / row[CABLES]
    return x, y, z


def correction(row, cables, state, on_bodies, px, py, pz, cy, sy):
    """Return Newton's step of y for a carrier at (px, py, pz), zero in its coordinates."""
    R, P, held = on_bodies[0], on_bodies[1 + int(row[HELD])], int(row[CABLES])
    f0, f1, f2 = 0.0, 0.0, 0.0
    a, b, c, d, e, f, g, h, q = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    for j in range(held):
        i = int(row[WHICH + j])
        bx, by, bz = cables[i, ATTACHMENT], cables[i, ATTACHMENT + 1], cables[i, ATTACHMENT + 2]
        ax, ay, az = cables[i, ANCHOR], cables[i, ANCHOR + 1], cables[i, ANCHOR + 2]
        x = px + P[0] * ax + P[1] * ay + P[2] * az - state[0] - (R[0] * bx + R[1] * by + R[2] * bz)
        y = py + P[3] * ax + P[4] * ay + P[5] * az - state[1] - (R[3] * bx + R[4] * by + R[5] * bz)
        z = pz + P[6] * ax + P[7] * ay + P[8] * az - state[2] - (R[6] * bx + R[7] * by + R[8] * bz)
        off = 0.5 * (row[LENGTHS_OF + j] * row[LENGTHS_OF + j] - x * x - y * y - z * z)
        x, y = cy * x + sy * y, cy * y - sy * x
        # The derivatives of half the squared length by y1, y2 and y3; the last cable is the last equation.
        u = row[AXES] * x + row[AXES + 1] * y + row[AXES + 2] * z
        v = row[AXES + 3] * x + row[AXES + 4] * y + row[AXES + 5] * z
        w = row[AXES + 6] * x + row[AXES + 7] * y + row[AXES + 8] * z
        equation = 3 - held + j
        if equation == 0:
            a, b, c, f0 = u, v, w, off
        elif equation == 1:
            d, e, f, f1 = (u if held == 3 else 0.0), v, w, off
        else:
            g, h, q, f2 = (u if held == 3 else 0.0), (v if held >= 2 else 0.0), w, off
    det = a * (e * q - f * h) - b * (d * q - f * g) + c * (d * h - e * g)
    if abs(det) < 1e-300:
        return 0.0, 0.0, 0.0
    d0 = (f0 * (e * q - f * h) - b * (f1 * q - f * f2) + c * (f1 * h - e * f2)) / det
    d1 = (a * (f1 * q - f * f2) - f0 * (d * q - f * g) + c * (d * f2 - f1 * g)) / det
    d2 = (a * (e * f2 - f1 * h) - b * (d * f2 - f1 * g) + f0 * (d * h - e * g)) / det
    return d0, d1, d2


def write_directions(robot, tethers, motions, directions):
    """Write the coordinates of carriers as they move, and two derivatives over time.

    Parameters
    ----------
    robot
        As for `mechanics.write_rows`.
    tethers
        (k, TETHER_COLUMNS).
    motions
        (N, 1 + c, 18), pose, velocity and acceleration of platform and carriers.
    directions
        Result, (N, 3, f) [m, m/s, m/s^2].
    """
    bodies, cables, settings, _ = robot
    count, m, h = bodies.shape[0], cables.shape[0], STEP_OF_TIME
    state, on_bodies = np.zeros(BODY * count + CABLE_BLOCKS * m), np.zeros((count, BODY_WORK))
    command, motion = np.zeros(COMMANDS + m + CARRIER * count), np.zeros((count, 12))
    found = np.zeros((3, directions.shape[2]))
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
    """Write the coordinates, (f,), of carriers as they are placed; the inverse of `put_tethered`."""
    R = on_bodies[0]
    cy, sy = heading(R)
    first = 0
    for k in range(tethers.shape[0]):
        row, at = tethers[k], BODY * (1 + int(tethers[k, HELD]))
        mx, my, mz = middle_of(row, cables, R)
        x, y, z = state[at] - state[0] - mx, state[at + 1] - state[1] - my, state[at + 2] - state[2] - mz
        x, y = cy * x + sy * y, cy * y - sy * x
        for j in range(3 - int(row[CABLES])):
            axis = row[AXES + 3 * j :]
            places[first] = axis[0] * x + axis[1] * y + axis[2] * z
            first += 1


def write_carriers(robot, tethers, motion, carriers):
    """Write how carriers move if the platform and their coordinates do.

    Parameters
    ----------
    robot, tethers
        As for `write_directions`.
    motion
        (3, 6 + f), pose of the platform and the coordinates, and their two derivatives over time.
    carriers
        Result, (c, 3, 6): their positions and two derivatives over time; attitudes are read, and stay.
    """
    bodies, cables, settings, _ = robot
    count, m, h = bodies.shape[0], cables.shape[0], STEP_OF_TIME
    state, on_bodies = np.zeros(BODY * count + CABLE_BLOCKS * m), np.zeros((count, BODY_WORK))
    command, pose = np.zeros(COMMANDS + m + CARRIER * count), np.zeros(12)
    places, found = np.zeros(motion.shape[1] - 6), np.zeros((3, 3 * count))
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
        c = 1 + int(tethers[k, HELD])
        for j in range(3):
            before, now, after = found[0, 3 * c + j], found[1, 3 * c + j], found[2, 3 * c + j]
            carriers[c - 1, 0, j] = now
            carriers[c - 1, 1, j] = (after - before) / (2.0 * h)
            carriers[c - 1, 2, j] = (after - 2.0 * now + before) / (h * h)
