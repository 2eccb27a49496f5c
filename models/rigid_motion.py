"""The motion of a rigid body under thrust and torque in its own axes and the pull of cables, and its inverse.

    m (ddx - g) = f R e_z + F
    I alpha + omega x I omega = tau + M           (in the body's axes)

for thrust f along its z axis, torque tau, and the pull of its cables: F in {G}, M in its own axes about its CoM.
Coordinates are (x, y, z, roll, pitch, yaw) and their derivatives. Source: Newton and Euler.
"""

import casadi as ca
import numpy as np

from .rotation import Matrix, inverse_rate_matrix, rate_matrix, rate_matrix_derivative, rotation, turning


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
    """Return ddq, (6, 1), of a body with an inertia (3, 3) in its axes; the others are of `Carrier.acceleration`."""
    angles, rates = pose[3:6], velocity[3:6]
    linear = ca.DM(gravity) + (rotation(angles)[:, 2] * thrust + pull[0:3]) / mass
    Omega = rate_matrix(angles) @ rates
    alpha = ca.DM(np.linalg.inv(inertia)) @ (torque + pull[3:6] - ca.cross(Omega, ca.DM(inertia) @ Omega))
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

    Its inertia is (3, 3) in its axes; the other parameters are those of `Carrier.required_effort`.
    """
    R, Omega, alpha = turning(pose, velocity, acceleration)
    force = R.T @ (mass * (acceleration[:3] - ca.DM(gravity)) - pull[:3])
    return force, ca.DM(inertia) @ alpha + ca.cross(Omega, ca.DM(inertia) @ Omega) - pull[3:6]
