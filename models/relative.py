"""Paper F's form: the platform's motion relative to its carrier {A}, and the carrier's motion as a disturbance D_B.

    M_B ddX_b + F_B + D_B = A (t + dT) + W_e,   D_B = (D_F, D_M),   all in {A}

    D_F = m (R_A^T ddx_A + alpha_A x x_c + omega_A x (omega_A x x_c) + 2 omega_A x dx_c) - m R_A^T g
    D_M = I_A alpha_A + I_A (omega_A x R Omega) + (omega_A + R Omega) x I_A omega_A + omega_A x (R I_b Omega)

with x_c the CoM in {A}, R = ^A R_B, Omega = P_b dTheta_b, I_A = R I_b R^T and, in {A}, omega_A = P_a dTheta_a,
alpha_A = dP_a dTheta_a + P_a ddTheta_a. Without the carrier's motion D_B is the weight alone.

Source: paper F, Eqs. 26 to 38 as corrected.
"""

from __future__ import annotations

import casadi as ca

from .robot import Robot
from .rotation import (
    Matrix,
    angles_of,
    body_acceleration,
    body_rate,
    inverse_rate_matrix,
    rate_matrix_derivative,
    rotation,
)


def relative_inertial_wrench(robot: Robot, pose: Matrix, velocity: Matrix, acceleration: Matrix) -> Matrix:
    """Return M_B ddX_b + F_B, (6, 1), in {A}: the wrench for the relative motion, without gravity and carrier.

    Parameters
    ----------
    pose, velocity, acceleration
        (6, 1) each: of the platform frame relative to {A}, and its time derivatives expressed in {A}.
    """
    angles, rates = pose[3:6], velocity[3:6]
    R = rotation(angles)
    Omega = body_rate(angles, rates)
    alpha = body_acceleration(angles, rates, acceleration[3:6])
    com = ca.DM(robot.platform.com)
    a_com = acceleration[0:3] + R @ (ca.cross(alpha, com) + ca.cross(Omega, ca.cross(Omega, com)))
    I_b = ca.DM(robot.inertia)
    return ca.vertcat(robot.platform.mass * a_com, R @ (I_b @ alpha + ca.cross(Omega, I_b @ Omega)))


def base_disturbance(
    robot: Robot,
    pose: Matrix,
    velocity: Matrix,
    carrier_pose: Matrix,
    carrier_velocity: Matrix,
    carrier_acceleration: Matrix,
) -> Matrix:
    """Return D_B = (D_F, D_M), (6, 1), in {A} [N, N m]: the coupled quadrotor-disturbance term, weight included.

    Parameters
    ----------
    pose, velocity
        (6, 1) each: of the platform frame relative to {A}, expressed in {A}.
    carrier_pose, carrier_velocity, carrier_acceleration
        (6, 1) each: of {A} in {G} and its time derivatives.
    """
    R_A = rotation(carrier_pose[3:6])
    omega_A = body_rate(carrier_pose[3:6], carrier_velocity[3:6])
    alpha_A = body_acceleration(carrier_pose[3:6], carrier_velocity[3:6], carrier_acceleration[3:6])

    R = rotation(pose[3:6])
    Omega = body_rate(pose[3:6], velocity[3:6])
    com = ca.DM(robot.platform.com)
    x_c = pose[0:3] + R @ com
    dx_c = velocity[0:3] + R @ ca.cross(Omega, com)
    felt = R_A.T @ (carrier_acceleration[0:3] - ca.DM(robot.gravity))
    D_F = robot.platform.mass * (
        felt + ca.cross(alpha_A, x_c) + ca.cross(omega_A, ca.cross(omega_A, x_c)) + 2 * ca.cross(omega_A, dx_c)
    )

    I_b = ca.DM(robot.inertia)
    I_A = R @ I_b @ R.T
    D_M = (
        I_A @ alpha_A
        + I_A @ ca.cross(omega_A, R @ Omega)
        + ca.cross(omega_A + R @ Omega, I_A @ omega_A)
        + ca.cross(omega_A, R @ I_b @ Omega)
    )
    return ca.vertcat(D_F, D_M)


def motion_in_world(
    pose: Matrix,
    velocity: Matrix,
    acceleration: Matrix,
    carrier_pose: Matrix,
    carrier_velocity: Matrix,
    carrier_acceleration: Matrix,
) -> tuple[Matrix, Matrix, Matrix]:
    """Return pose, velocity and acceleration in {G}, (6, 1) each, of a frame that moves relative to {A} as given.

    The Euler angles come out in the ranges of `rotation.angles_of`; their rates do not exist at pitch = +-90 degrees.
    """
    R_A = rotation(carrier_pose[3:6])
    omega_A = body_rate(carrier_pose[3:6], carrier_velocity[3:6])
    alpha_A = body_acceleration(carrier_pose[3:6], carrier_velocity[3:6], carrier_acceleration[3:6])
    x, dx, ddx = pose[0:3], velocity[0:3], acceleration[0:3]
    position = carrier_pose[0:3] + R_A @ x
    speed = carrier_velocity[0:3] + R_A @ (ca.cross(omega_A, x) + dx)
    acceleration_G = carrier_acceleration[0:3] + R_A @ (
        ddx + ca.cross(alpha_A, x) + ca.cross(omega_A, ca.cross(omega_A, x)) + 2 * ca.cross(omega_A, dx)
    )

    R = rotation(pose[3:6])
    Omega = body_rate(pose[3:6], velocity[3:6])
    alpha = body_acceleration(pose[3:6], velocity[3:6], acceleration[3:6])
    angles = angles_of(R_A @ R)
    total_rate = R.T @ omega_A + Omega  # in platform axes
    total_alpha = R.T @ (alpha_A + ca.cross(omega_A, R @ Omega)) + alpha
    rates = inverse_rate_matrix(angles) @ total_rate
    rate_rates = inverse_rate_matrix(angles) @ (total_alpha - rate_matrix_derivative(angles, rates) @ rates)
    return ca.vertcat(position, angles), ca.vertcat(speed, rates), ca.vertcat(acceleration_G, rate_rates)
