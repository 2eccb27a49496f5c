"""Paper F's form: the platform's motion relative to its carrier {A}, and the carrier's motion as a disturbance D_B.

    M_B ddX_b + F_B + D_B = A (t + dT) + W_e,   D_B = (D_F, D_M),   all in {A}

    D_F = m (R_A^T ddx_A + alpha_A x x_c + omega_A x (omega_A x x_c) + 2 omega_A x dx_c) - m R_A^T g
    D_M = I_A alpha_A + I_A (omega_A x R Omega) + (omega_A + R Omega) x I_A omega_A + omega_A x (R I_b Omega)

with x_c the CoM in {A}, R = ^A R_B, Omega = P_b dTheta_b, I_A = R I_b R^T and, in {A}, omega_A = P_a dTheta_a,
alpha_A = dP_a dTheta_a + P_a ddTheta_a. Without the carrier's motion D_B is the weight alone.

Source: paper F, Eqs. 26 to 38 as corrected.
"""

import casadi as ca

from .motion import Motion
from .robot import Robot
from .rotation import Matrix, angles_of, body_rate, inverse_rate_matrix, rate_matrix_derivative, rotation, turning


def base_disturbance(robot: Robot, motion: Motion) -> Matrix:
    """Return D_B = (D_F, D_M), (6, 1), in {A} [N, N m]: the coupled quadrotor-disturbance term, weight included."""
    R_A, omega_A, alpha_A = turning(motion.carrier_pose, motion.carrier_velocity, motion.carrier_acceleration)
    R, Omega = rotation(motion.pose[3:6]), body_rate(motion.pose[3:6], motion.velocity[3:6])
    com = ca.DM(robot.platform.com)
    x_c = motion.pose[0:3] + R @ com
    dx_c = motion.velocity[0:3] + R @ ca.cross(Omega, com)
    felt = R_A.T @ (motion.carrier_acceleration[0:3] - ca.DM(robot.gravity))
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


def motion_in_world(motion: Motion) -> tuple[Matrix, Matrix, Matrix]:
    """Return pose, velocity and acceleration in {G}, (6, 1) each, of a frame that moves relative to {A} as given.

    The Euler angles come out in the ranges of `rotation.angles_of`; their rates do not exist at pitch = +-90 degrees.
    """
    R_A, omega_A, alpha_A = turning(motion.carrier_pose, motion.carrier_velocity, motion.carrier_acceleration)
    x, dx, ddx = motion.pose[0:3], motion.velocity[0:3], motion.acceleration[0:3]
    position = motion.carrier_pose[0:3] + R_A @ x
    speed = motion.carrier_velocity[0:3] + R_A @ (ca.cross(omega_A, x) + dx)
    acceleration_G = motion.carrier_acceleration[0:3] + R_A @ (
        ddx + ca.cross(alpha_A, x) + ca.cross(omega_A, ca.cross(omega_A, x)) + 2 * ca.cross(omega_A, dx)
    )

    R, Omega, alpha = turning(motion.pose, motion.velocity, motion.acceleration)
    angles = angles_of(R_A @ R)
    total_rate = R.T @ omega_A + Omega  # in platform axes
    total_alpha = R.T @ (alpha_A + ca.cross(omega_A, R @ Omega)) + alpha
    rates = inverse_rate_matrix(angles) @ total_rate
    rate_rates = inverse_rate_matrix(angles) @ (total_alpha - rate_matrix_derivative(angles, rates) @ rates)
    return ca.vertcat(position, angles), ca.vertcat(speed, rates), ca.vertcat(acceleration_G, rate_rates)
