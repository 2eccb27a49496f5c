"""Where anchors and attachments are, how long the cables are, and the wrench matrix A.

Cable i runs from its anchor A_i on a carrier to its attachment B_i on the platform:

    l_i = A_i - B_i,   u_i = l_i / |l_i|   (the direction in which it pulls the platform)
    A = [ u_1 ... u_m ; r_1 x u_1 ... r_m x u_m ],   r_i = R (b_i - c)   (about the CoM, c in the platform frame)

All functions take CasADi SX, MX or DM. Source: paper F, Eqs. 2 to 5; paper C, Eqs. 1, 2, 5, 6 as corrected.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from .rotation import Matrix, rotation

if TYPE_CHECKING:
    from .robot import Robot


def transform(pose: Matrix, points: ca.DM | np.ndarray) -> Matrix:
    """X + R p of each column p of `points` (3, k), in the frame that `pose` (6, 1) is given in [m]."""
    return rotation(pose[3:6]) @ ca.DM(points) + pose[0:3]


def anchors(robot: Robot, carrier_pose: Matrix) -> Matrix:
    """A_i in {G}, (3, m), in [m], for carriers at `carrier_pose` (c, 6)."""
    columns = []
    for cable, carrier in enumerate(robot.carrier_of_cable):
        columns.append(transform(carrier_pose[int(carrier), :].T, robot.anchors[cable]))
    return ca.horzcat(*columns)


def cable_vectors(robot: Robot, pose: Matrix, anchor_points: Matrix) -> Matrix:
    """l_i = A_i - B_i, (3, m), in [m], for anchors (3, m) in the frame that `pose` (6, 1) is given in."""
    return anchor_points - transform(pose, robot.attachments.T)


def norms(vectors: Matrix) -> Matrix:
    """Euclidean length of each column, (m, 1)."""
    return ca.sqrt(ca.sum1(vectors**2)).T


def wrench_matrix(robot: Robot, pose: Matrix, anchor_points: Matrix) -> Matrix:
    """A, (6, m): force [N per N] and moment about the CoM [N m per N] of each cable, in the frame of `pose`."""
    vectors = cable_vectors(robot, pose, anchor_points)
    directions = vectors / ca.repmat(norms(vectors).T, 3, 1)
    com = np.array(robot.platform.com)
    arms = rotation(pose[3:6]) @ ca.DM((robot.attachments - com).T)  # (3, m)
    moments = [ca.cross(arms[:, i], directions[:, i]) for i in range(robot.m)]
    return ca.vertcat(directions, ca.horzcat(*moments))


def home_lengths(robot: Robot) -> np.ndarray:
    """Cable lengths with platform and carriers at home, (m,), in [m]."""
    at_home = cable_vectors(robot, ca.DM(robot.home), anchors(robot, ca.DM(robot.carrier_home)))
    return norms(at_home).full().ravel()


def default_home(robot: Robot) -> np.ndarray:
    """Home pose in {G} for a robot file that names none: level, amid the anchors, or below them if it hangs.

    It hangs if the anchors' heights differ by less than a tenth of their horizontal spread; then it is placed as far
    below their centre as they are wide, where a suspended platform has room.
    """
    points = anchors(robot, ca.DM(robot.carrier_home)).full().T  # (m, 3)
    centre = points.mean(axis=0)
    spread = np.linalg.norm(points[:, :2] - centre[:2], axis=1).max()
    reach = max(spread, np.linalg.norm(robot.attachments, axis=1).max(), 1e-3)
    if np.ptp(points[:, 2]) < 0.1 * reach:
        centre[2] -= reach
    return np.concatenate([centre, np.zeros(3)])
