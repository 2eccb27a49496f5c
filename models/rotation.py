"""Orientation by roll, pitch and yaw: R, the rate matrix P and its derivative, for CasADi SX, MX and DM alike.

    R = Rz(yaw) Ry(pitch) Rx(roll)        from the turned frame into the fixed one
    Omega = P(roll, pitch) dTheta         body rate in the turned frame, Theta = (roll, pitch, yaw)
    alpha = dP dTheta + P ddTheta         its derivative (paper F, Eq. 31 omits P)

Source: paper F, Eqs. 1, 27, 28, 31 as corrected.
"""

import casadi as ca

from .arrays import Matrix


def rotation(angles: Matrix) -> Matrix:
    """Return R = Rz(yaw) Ry(pitch) Rx(roll), (3, 3), of angles (roll, pitch, yaw), (3, 1) [rad]."""
    (sr, sp, sy), (cr, cp, cy) = ca.vertsplit(ca.sin(angles)), ca.vertsplit(ca.cos(angles))
    return ca.vertcat(
        ca.horzcat(cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        ca.horzcat(sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        ca.horzcat(-sp, cp * sr, cp * cr),
    )


def rate_matrix(angles: Matrix) -> Matrix:
    """Return P, (3, 3): body rate Omega = P dTheta. Singular at pitch = +-90 degrees."""
    (sr, sp), (cr, cp) = ca.vertsplit(ca.sin(angles[:2])), ca.vertsplit(ca.cos(angles[:2]))
    return ca.vertcat(ca.horzcat(1, 0, -sp), ca.horzcat(0, cr, sr * cp), ca.horzcat(0, -sr, cr * cp))


def rate_matrix_derivative(angles: Matrix, rates: Matrix) -> Matrix:
    """Return the time derivative of P, (3, 3), at the Euler rates dTheta in [rad/s]."""
    d_roll, d_pitch, _ = ca.vertsplit(rates)
    (sr, sp), (cr, cp) = ca.vertsplit(ca.sin(angles[:2])), ca.vertsplit(ca.cos(angles[:2]))
    return ca.vertcat(
        ca.horzcat(0, 0, -cp * d_pitch),
        ca.horzcat(0, -sr * d_roll, cr * cp * d_roll - sr * sp * d_pitch),
        ca.horzcat(0, -cr * d_roll, -sr * cp * d_roll - cr * sp * d_pitch),
    )


def body_rate(angles: Matrix, rates: Matrix) -> Matrix:
    """Return Omega = P dTheta, (3, 1), in the turned frame [rad/s]."""
    return rate_matrix(angles) @ rates


def turning(pose: Matrix, velocity: Matrix, acceleration: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return R, Omega and alpha of a frame from its coordinates and their derivatives: (3, 3), (3, 1) and (3, 1)."""
    angles, rates = pose[3:6], velocity[3:6]
    alpha = rate_matrix_derivative(angles, rates) @ rates + rate_matrix(angles) @ acceleration[3:6]
    return rotation(angles), body_rate(angles, rates), alpha


def inverse_rate_matrix(angles: Matrix) -> Matrix:
    """Return P^-1, (3, 3): dTheta = P^-1 Omega. Infinite at pitch = +-90 degrees."""
    (sr, sp), (cr, cp) = ca.vertsplit(ca.sin(angles[:2])), ca.vertsplit(ca.cos(angles[:2]))
    tp = sp / cp
    return ca.vertcat(ca.horzcat(1, sr * tp, cr * tp), ca.horzcat(0, cr, -sr), ca.horzcat(0, sr / cp, cr / cp))


def angles_of(R: Matrix) -> Matrix:
    """Return (roll, pitch, yaw) of R, (3, 1), in [rad]: pitch in [-90, 90] degrees, roll and yaw in (-180, 180]."""
    roll = ca.atan2(R[2, 1], R[2, 2])
    sr, cr = ca.sin(roll), ca.cos(roll)
    # The yaw that belongs to this roll: at a pitch of 90 degrees both are rounding, and only together an attitude.
    yaw = ca.atan2(sr * R[0, 2] - cr * R[0, 1], cr * R[1, 1] - sr * R[1, 2])
    return ca.vertcat(roll, ca.atan2(-R[2, 0], ca.sqrt(R[2, 1] ** 2 + R[2, 2] ** 2)), yaw)
