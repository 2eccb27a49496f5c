"""The motion of a rigid body under thrust and torque in its own axes and the pull of cables, and its inverse.

    m (ddx - g) = f R e_z + F
    I alpha + omega x I omega = tau + M           (in the body's axes)

for thrust f along its z axis, torque tau, and the pull of its cables: F in {G}, M in its own axes about its CoM.
Coordinates are (x, y, z, roll, pitch, yaw) and their derivatives. Source: Newton and Euler.
"""

import casadi as ca
import numpy as np

from .rotation import (
    Matrix,
    body_acceleration,
    body_rate,
    inverse_rate_matrix,
    rate_matrix,
    rate_matrix_derivative,
    rotation,
)


def acceleration(
    mass: float,
    inertia: np.ndarray,
    pose: Matrix,
    velocity: Matrix,
    thrust: Matrix,
    torque: Matrix,
    pull: Matrix,
    gravity: np.ndarray,
) -> Matrix:
    """Return ddq, (6, 1).

    Parameters
    ----------
    inertia
        About the CoM in the body's axes, (3, 3) [kg m^2].
    pose, velocity
        (6, 1) each, of its frame in {G}.
    thrust
        Total thrust f along its z axis [N].
    torque
        tau about its axes, (3, 1) [N m].
    pull
        Force in {G} [N] and moment about its CoM in its own axes [N m] of its cables, (6, 1).
    gravity
        (3,) in {G} [m/s^2].
    """
    angles, rates = pose[3:6], velocity[3:6]
    R = rotation(angles)
    linear = ca.DM(gravity) + (R[:, 2] * thrust + pull[0:3]) / mass
    I_b = ca.DM(inertia)
    Omega = rate_matrix(angles) @ rates
    alpha = ca.DM(np.linalg.inv(inertia)) @ (torque + pull[3:6] - ca.cross(Omega, I_b @ Omega))
    angular = inverse_rate_matrix(angles) @ (alpha - rate_matrix_derivative(angles, rates) @ rates)
    return ca.vertcat(linear, angular)


def required_wrench(
    mass: float,
    inertia: np.ndarray,
    pose: Matrix,
    velocity: Matrix,
    acceleration: Matrix,
    pull: Matrix,
    gravity: np.ndarray,
) -> tuple[Matrix, Matrix]:
    """Return the force [N] and the torque [N m] in the body's axes that a motion requires, (3, 1) each.

    Parameters
    ----------
    acceleration
        (6, 1), of its frame in {G}; the other parameters are those of `acceleration`.
    """
    R = rotation(pose[3:6])
    force = R.T @ (mass * (acceleration[:3] - ca.DM(gravity)) - pull[:3])
    I_b = ca.DM(inertia)
    Omega = body_rate(pose[3:6], velocity[3:6])
    alpha = body_acceleration(pose[3:6], velocity[3:6], acceleration[3:6])
    return force, I_b @ alpha + ca.cross(Omega, I_b @ Omega) - pull[3:6]
