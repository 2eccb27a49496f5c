"""Newton and Euler for the platform in {G}: the wrench that its motion needs.

    force  : m (a_c - g)                       a_c = ddx + alpha x R c + omega x (omega x R c)
    moment : I alpha + omega x I omega         I = R I_b R^T, omega = R Omega, alpha = R (dP dTheta + P ddTheta)

about the CoM, whose place in the platform frame is c. Source: paper F, Eqs. 24 and 29; paper C,
Eq. 4, which omits the gyroscopic term, and Eq. 12, which takes ddTheta for the angular acceleration.
"""

from __future__ import annotations

import casadi as ca

from .robot import Robot
from .rotation import Matrix, body_acceleration, body_rate, rotation


def com_velocity(robot: Robot, pose: Matrix, velocity: Matrix) -> Matrix:
    """Return the velocity of the CoM, (3, 1), in {G} [m/s]."""
    R = rotation(pose[3:6])
    omega = R @ body_rate(pose[3:6], velocity[3:6])
    return velocity[0:3] + ca.cross(omega, R @ ca.DM(robot.platform.com))


def inertial_wrench(robot: Robot, pose: Matrix, velocity: Matrix, acceleration: Matrix) -> Matrix:
    """Return w, (6, 1): force [N] and moment about the CoM [N m] in {G} against inertia and gravity.

    Parameters
    ----------
    pose, velocity, acceleration
        (6, 1) each: (x, y, z, roll, pitch, yaw) of the platform frame in {G} and its first two time derivatives.
    """
    angles, rates = pose[3:6], velocity[3:6]
    R = rotation(angles)
    omega = R @ body_rate(angles, rates)
    alpha = R @ body_acceleration(angles, rates, acceleration[3:6])
    offset = R @ ca.DM(robot.platform.com)
    a_com = acceleration[0:3] + ca.cross(alpha, offset) + ca.cross(omega, ca.cross(omega, offset))
    inertia = R @ ca.DM(robot.inertia) @ R.T
    force = robot.platform.mass * (a_com - ca.DM(robot.gravity))
    moment = inertia @ alpha + ca.cross(omega, inertia @ omega)
    return ca.vertcat(force, moment)
