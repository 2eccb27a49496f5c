"""Stiffness and natural frequencies of a robot about an equilibrium.

The platform is displaced by a small twist delta = (translation of the CoM, rotation vector), both in {G}. Its cables
then pull with another wrench, -K delta. With inextensible cables under constant tensions only the geometry changes,
with elastic ones the tensions too:

    K = K_t + sum_i k_i a_i a_i^T,   k_i = E A / L0_i,   L0_i = l_i / (1 + t_i / E A)

with a_i the columns of A and K_t = -d(A t)/d delta at constant t. Frequencies solve K v = (2 pi f)^2 M v with
M = blockdiag(m, I) about the CoM; inextensible cables leave the motions with A^T delta = 0.

Source: Behzadipour and Khajepour, "Stiffness of cable-based parallel manipulators with application to stability
analysis", 2006, for the split; the derivative is CasADi's.
"""

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from . import points
from .cables.elastic import axial_stiffness, unstrained_length
from .cables.pulley import exit_points
from .robot import Robot
from .rotation import Matrix, rotation


def tension_stiffness(robot: Robot, pose: Matrix, anchor_points: Matrix, axes: Matrix, tensions: Matrix) -> Matrix:
    """Return K_t, the stiffness at constant tensions, (6, 6), in {G} about the CoM [N/m, N, N m]."""
    delta = ca.SX.sym("delta", 6)
    symbols = [
        ca.SX.sym("pose", 6),
        ca.SX.sym("anchors", 3, robot.m),
        ca.SX.sym("axes", 3, robot.m),
        ca.SX.sym("t", robot.m),
    ]
    R = rotation(symbols[0][3:6])
    com = symbols[0][0:3] + R @ ca.DM(robot.platform.com)
    arms = R @ ca.DM((robot.attachments - np.array(robot.platform.com)).T)
    turned = arms + ca.skew(delta[3:6]) @ arms  # to first order, which suffices for a derivative at zero
    moved = ca.repmat(com + delta[0:3], 1, robot.m) + turned
    directions = exit_points(symbols[1], symbols[2], robot.pulley_radii, moved).directions
    forces = directions * ca.repmat(symbols[3].T, 3, 1)
    moments = [ca.cross(turned[:, i], forces[:, i]) for i in range(robot.m)]
    wrench = ca.vertcat(ca.sum2(forces), ca.sum2(ca.horzcat(*moments)))
    K = ca.substitute(-ca.jacobian(wrench, delta), delta, ca.DM.zeros(6))
    return ca.Function("tension_stiffness", symbols, [K])(pose, anchor_points, axes, tensions)


def cable_stiffness(robot: Robot, A: Matrix, lengths: Matrix, tensions: Matrix) -> Matrix:
    """Sum k_i a_i a_i^T, (6, 6), in {G} about the CoM [N/m, N, N m], over the cables that pull."""
    EA = ca.DM([cable.stiffness or np.inf for cable in robot.cables])
    k = axial_stiffness(EA, unstrained_length(lengths, tensions, EA))
    k = ca.if_else(tensions > 0, k, 0)  # a slack cable has no stiffness
    return A @ ca.diag(k) @ A.T


def whitening(robot: Robot, pose: np.ndarray) -> np.ndarray:
    """Return C with C M C^T = 1 in the coordinates that move, (..., k, k), at poses (..., 6).

    The eigenvalues of C K C^T are the squares of the natural frequencies [rad^2/s^2].
    """
    moves = np.flatnonzero(robot.dof_mask[:3]).size
    turns = np.flatnonzero(robot.dof_mask[3:])
    C = np.zeros((*pose.shape[:-1], moves + turns.size, moves + turns.size))
    C[..., :moves, :moves] = np.eye(moves) / np.sqrt(robot.platform.mass)
    if turns.size == 3:  # the factor of R I R^T is a turned one, at a third of the cost
        whitened = np.linalg.inv(np.linalg.cholesky(robot.inertia))
        C[..., moves:, moves:] = whitened @ points.rotations(pose[..., 3:]).swapaxes(-1, -2)
    elif turns.size:
        R = points.rotations(pose[..., 3:])[..., turns, :]
        C[..., moves:, moves:] = np.linalg.inv(np.linalg.cholesky(R @ robot.inertia @ R.swapaxes(-1, -2)))
    return C


def whitened(robot: Robot, K: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return C K C^T in the coordinates that move, (..., k, k), of stiffnesses K (..., 6, 6); C is their `whitening`.

    At an equilibrium K is symmetric but for rounding and residual wrenches, which are cut off here.
    """
    rows = np.flatnonzero(robot.dof_mask)
    K = K if rows.size == 6 else K[..., rows[:, None], rows]
    return C @ ((K + K.swapaxes(-1, -2)) / 2) @ C.swapaxes(-1, -2)


def frequency(square: ArrayLike) -> np.ndarray:
    """Return frequencies [Hz] from squares of angular ones [rad^2/s^2], negative for negative squares.

    An unstable motion has a negative frequency: minus the rate of growth over 2 pi.
    """
    return np.sign(square) * np.sqrt(np.abs(square)) / (2 * np.pi)
