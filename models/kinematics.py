"""Where anchors and attachments are, how long the cables are, and the wrench matrix A.

Cable i runs from its anchor A_i on a carrier to its attachment B_i on the platform:

    l_i = A_i - B_i,   u_i = l_i / |l_i|   (the direction in which it pulls the platform)
    A = [ u_1 ... u_m ; r_1 x u_1 ... r_m x u_m ],   r_i = R (b_i - c)   (about the CoM, c in the platform frame)

Poses and points are CasADi SX, MX or DM; geometry is NumPy arrays with one row per cable. Source: paper F, Eqs. 2 to 5;
paper C, Eqs. 1, 2, 5, 6 as corrected.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from .cables.pulley import Exit, exit_points
from .rotation import Matrix, rotation


def transform(pose: Matrix, points: np.ndarray) -> Matrix:
    """Place x + R p of each row p of `points` (k, 3), as columns (3, k), in the frame of `pose` (6, 1) [m]."""
    return rotation(pose[3:6]) @ ca.DM(points.T) + pose[0:3]


def anchors(points: np.ndarray, carrier_of_cable: np.ndarray, carrier_pose: Matrix) -> Matrix:
    """Place anchors `points` (m, 3), given in the frames of carriers at `carrier_pose` (c, 6), in {G}: (3, m) [m]."""
    owners = zip(points, carrier_of_cable.tolist(), strict=True)
    return ca.horzcat(*(transform(carrier_pose[carrier, :].T, point[None]) for point, carrier in owners))


def axes(directions: np.ndarray, carrier_of_cable: np.ndarray, carrier_pose: Matrix) -> Matrix:
    """Turn axes `directions` (m, 3), given in the frames of carriers at `carrier_pose` (c, 6), into {G}: (3, m) [-]."""
    owners = zip(directions, carrier_of_cable.tolist(), strict=True)
    return ca.horzcat(*(rotation(carrier_pose[carrier, 3:6].T) @ ca.DM(direction) for direction, carrier in owners))


def cables(
    attachments: np.ndarray, pose: Matrix, anchor_points: Matrix, axis_directions: Matrix, radii: np.ndarray
) -> Exit:
    """Return the `Exit` of the cables, in the frame of `pose` (6, 1), anchors (3, m) and axes (3, m)."""
    return exit_points(anchor_points, axis_directions, radii, transform(pose, attachments))


def wrench_matrix(attachments: np.ndarray, com: np.ndarray, pose: Matrix, directions: Matrix) -> Matrix:
    """Return A, (6, m): force [N per N] and moment about the CoM [N m per N] of each cable, in the frame of `pose`."""
    arms = rotation(pose[3:6]) @ ca.DM((attachments - com).T)  # (3, m)
    moments = [ca.cross(arms[:, i], directions[:, i]) for i in range(len(attachments))]
    return ca.vertcat(directions, ca.horzcat(*moments))
