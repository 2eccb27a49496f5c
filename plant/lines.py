"""Kernel: how the cables run between bodies, and the forces that act on these.

With d = B - x_c from the carrier's frame to the attachment, and w the velocity of B in the carrier's frame, in {G}:

    dl/dt = -u . w        d2l/dt2 = -u . (acceleration of B in the carrier's frame) + w . H w

A cable with the tension t pulls with t u at B on the platform and with -t u along the same line on its carrier. Over a
pulley the direction comes from `models.cables.pulley`, and H = n n^T / s + sin(theta) / a y y^T, with s the free part
from the sheave to B, n across it in the sheave's plane, y across that plane, a the distance of B from the swivel axis.
At a point anchor H = (1 - u u^T) / l.
"""

import math

from .layout import (
    ACTUATOR,
    ACTUATORS,
    AIR,
    ANCHOR,
    ARM,
    ATTACHMENT,
    AXIS,
    BODY,
    CARRIER,
    CARRIER_ARM,
    COMMANDS,
    CURVATURE,
    DAMPING,
    DRAG,
    E_RATE,
    FORCE,
    FREE,
    GRAVITY,
    L_RATE,
    LENGTH_RATE,
    LIFT,
    MASS,
    MOMENT,
    MOST_ACTUATORS,
    MOTION,
    OMEGA,
    OWNER,
    PRINTED,
    RADIUS,
    STIFFNESS,
    VELOCITY,
    WIND,
    WRENCH,
    E,
    L,
    T,
    U,
)


def run_cables(cables, state, on_bodies, on_cables, places):
    """Write direction, arms, length, elongation, their rates and the length's curvature of each cable."""
    R, m = on_bodies, cables.shape[0]
    for i in range(m):
        c = int(cables[i, OWNER])
        at = BODY * c
        bx, by, bz = cables[i, ATTACHMENT], cables[i, ATTACHMENT + 1], cables[i, ATTACHMENT + 2]
        rx = R[0, 0] * bx + R[0, 1] * by + R[0, 2] * bz
        ry = R[0, 3] * bx + R[0, 4] * by + R[0, 5] * bz
        rz = R[0, 6] * bx + R[0, 7] * by + R[0, 8] * bz
        dx, dy, dz = state[0] + rx - state[at], state[1] + ry - state[at + 1], state[2] + rz - state[at + 2]
        ax, ay, az = cables[i, ANCHOR], cables[i, ANCHOR + 1], cables[i, ANCHOR + 2]
        # From the attachment to the anchor.
        px = R[c, 0] * ax + R[c, 1] * ay + R[c, 2] * az - dx
        py = R[c, 3] * ax + R[c, 4] * ay + R[c, 5] * az - dy
        pz = R[c, 6] * ax + R[c, 7] * ay + R[c, 8] * az - dz
        ox, oy, oz = R[0, OMEGA], R[0, OMEGA + 1], R[0, OMEGA + 2]
        cx, cy, cz = R[c, OMEGA], R[c, OMEGA + 1], R[c, OMEGA + 2]
        wx = state[VELOCITY] + oy * rz - oz * ry - state[at + VELOCITY] - (cy * dz - cz * dy)
        wy = state[VELOCITY + 1] + oz * rx - ox * rz - state[at + VELOCITY + 1] - (cz * dx - cx * dz)
        wz = state[VELOCITY + 2] + ox * ry - oy * rx - state[at + VELOCITY + 2] - (cx * dy - cy * dx)
        length = math.sqrt(px * px + py * py + pz * pz)
        inverse = 1.0 / length if length > 1e-12 else 0.0  # of no length, and so of no direction: it does not pull
        ux, uy, uz = px * inverse, py * inverse, pz * inverse
        if cables[i, RADIUS] == 0.0:
            along = ux * wx + uy * wy + uz * wz
            curvature = (wx * wx + wy * wy + wz * wz - along * along) * inverse
        else:
            r = cables[i, RADIUS]
            kx, ky, kz = cables[i, AXIS], cables[i, AXIS + 1], cables[i, AXIS + 2]
            qx = R[c, 0] * kx + R[c, 1] * ky + R[c, 2] * kz
            qy = R[c, 3] * kx + R[c, 4] * ky + R[c, 5] * kz
            qz = R[c, 6] * kx + R[c, 7] * ky + R[c, 8] * kz
            up = -(px * qx + py * qy + pz * qz)
            ex, ey, ez = -px - up * qx, -py - up * qy, -pz - up * qz
            distance = max(math.sqrt(ex * ex + ey * ey + ez * ez), 1e-12)
            ex, ey, ez = ex / distance, ey / distance, ez / distance
            out = distance - r
            # Inside of the sheave there is no tangent; then the free part has no length.
            free = math.sqrt(max(distance * distance - 2.0 * distance * r + up * up, 1e-18))
            square = out * out + up * up
            # The free part runs along t = sine e + cosine k.
            sine, cosine = (free * out + r * up) / square, (free * up - r * out) / square
            ux, uy, uz = -sine * ex - cosine * qx, -sine * ey - cosine * qy, -sine * ez - cosine * qz
            length = r * (math.pi - math.atan2(free, r) - math.atan2(up, out)) + free
            across = (qy * ez - qz * ey) * wx + (qz * ex - qx * ez) * wy + (qx * ey - qy * ex) * wz
            inside = cosine * (ex * wx + ey * wy + ez * wz) - sine * (qx * wx + qy * wy + qz * wz)
            curvature = inside * inside / free + sine * across * across / distance
        on_cables[i, U], on_cables[i, U + 1], on_cables[i, U + 2] = ux, uy, uz
        on_cables[i, ARM], on_cables[i, ARM + 1], on_cables[i, ARM + 2] = rx, ry, rz
        on_cables[i, CARRIER_ARM], on_cables[i, CARRIER_ARM + 1], on_cables[i, CARRIER_ARM + 2] = dx, dy, dz
        rate = -(ux * wx + uy * wy + uz * wz)
        on_cables[i, L], on_cables[i, L_RATE], on_cables[i, CURVATURE] = length, rate, curvature
        # Without meaning where tensions are commanded.
        on_cables[i, E] = length - state[places + i]
        on_cables[i, E_RATE] = rate - state[places + LENGTH_RATE * m + i]


def pull_of(cables, state, on_cables, places, i):
    """Return E A e / L0 + C de/dt of an elastic cable [N], whether or not it pulls."""
    unstrained = state[places + i]
    return cables[i, STIFFNESS] * on_cables[i, E] / unstrained + cables[i, DAMPING] * on_cables[i, E_RATE]


def load_bodies(bodies, settings, command, on_bodies, state, cable_count):
    """Write what acts on free bodies beside cables: gravity, actuators, air and disturbance."""
    for b in range(bodies.shape[0]):
        if bodies[b, MOTION] != FREE:
            continue
        for i in range(3):
            on_bodies[b, FORCE + i] = bodies[b, MASS + i] * settings[GRAVITY + i]
            on_bodies[b, MOMENT + i] = 0.0
        if b > 0:
            at = COMMANDS + cable_count + CARRIER * (b - 1)
            for a in range(MOST_ACTUATORS):
                first = ACTUATORS + ACTUATOR * a
                value = min(max(command[at + a], bodies[b, first + 6]), bodies[b, first + 7])
                if value != 0.0:
                    for i in range(3):
                        for j in range(3):
                            turned = on_bodies[b, 3 * i + j] * value
                            on_bodies[b, FORCE + i] += turned * bodies[b, first + j]
                            on_bodies[b, MOMENT + i] += turned * bodies[b, first + 3 + j]
    if command[AIR] != 0.0:
        x, y = command[WIND] - state[VELOCITY], command[WIND + 1] - state[VELOCITY + 1]
        signed = settings[PRINTED] == 0.0
        on_bodies[0, FORCE] += settings[DRAG] * (x * abs(x) if signed else x * x)
        on_bodies[0, FORCE + 1] += settings[DRAG] * (y * abs(y) if signed else y * y)
        on_bodies[0, FORCE + 2] += settings[LIFT] * (x * x + y * y)
    for i in range(3):
        on_bodies[0, FORCE + i] += command[WRENCH + i]
        on_bodies[0, MOMENT + i] += command[WRENCH + 3 + i]


def pull_bodies(bodies, cables, on_bodies, on_cables):
    """Add the pull of all cables to the platform and to the carriers that feel it."""
    fx = fy = fz = mx = my = mz = 0.0
    for i in range(cables.shape[0]):
        tension = on_cables[i, T]
        if tension == 0.0:
            continue
        x, y, z = tension * on_cables[i, U], tension * on_cables[i, U + 1], tension * on_cables[i, U + 2]
        rx, ry, rz = on_cables[i, ARM], on_cables[i, ARM + 1], on_cables[i, ARM + 2]
        fx += x
        fy += y
        fz += z
        mx += ry * z - rz * y
        my += rz * x - rx * z
        mz += rx * y - ry * x
        c = int(cables[i, OWNER])
        if bodies[c, MOTION] == FREE:
            dx, dy, dz = on_cables[i, CARRIER_ARM], on_cables[i, CARRIER_ARM + 1], on_cables[i, CARRIER_ARM + 2]
            on_bodies[c, FORCE] -= x
            on_bodies[c, FORCE + 1] -= y
            on_bodies[c, FORCE + 2] -= z
            on_bodies[c, MOMENT] -= dy * z - dz * y
            on_bodies[c, MOMENT + 1] -= dz * x - dx * z
            on_bodies[c, MOMENT + 2] -= dx * y - dy * x
    on_bodies[0, FORCE] += fx
    on_bodies[0, FORCE + 1] += fy
    on_bodies[0, FORCE + 2] += fz
    on_bodies[0, MOMENT] += mx
    on_bodies[0, MOMENT + 1] += my
    on_bodies[0, MOMENT + 2] += mz
