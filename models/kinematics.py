"""Where anchors and attachments are, how long the cables are, and the wrench matrix A.

Cable i runs from its anchor A_i on a carrier to its attachment B_i on the platform:

    l_i = A_i - B_i,   u_i = l_i / |l_i|   (the direction in which it pulls the platform)
    A = [ u_1 ... u_m ; r_1 x u_1 ... r_m x u_m ],   r_i = R (b_i - c)   (about the CoM, c in the platform frame)

Poses and points are CasADi SX, MX or DM. Source: paper F, Eqs. 2 to 5;
paper C, Eqs. 1, 2, 5, 6 as corrected.
"""

from collections.abc import Callable

import casadi as ca
import numpy as np

from .cables.pulley import Exit, exit_points
from .robot import Robot
from .rotation import Matrix, rotation


def transform(pose: Matrix, points: np.ndarray) -> Matrix:
    """Place x + R p of each row p of `points` (k, 3), as columns (3, k), in the frame of `pose` (6, 1) [m]."""
    return rotation(pose[3:6]) @ ca.DM(points.T) + pose[0:3]


def anchors(robot: Robot, carrier_pose: Matrix) -> Matrix:
    """Place the anchors of a robot with carriers at `carrier_pose` (c, 6) in {G}: (3, m) [m]."""
    return _by_carrier(robot, robot.anchors, carrier_pose, transform)


def axes(robot: Robot, carrier_pose: Matrix) -> Matrix:
    """Turn the swivel axes of a robot's pulleys, with carriers at `carrier_pose` (c, 6), into {G}: (3, m) [-]."""
    return _by_carrier(robot, robot.pulley_axes, carrier_pose, lambda pose, its: rotation(pose[3:6]) @ ca.DM(its.T))


def _by_carrier(
    robot: Robot, vectors: np.ndarray, carrier_pose: Matrix, move: Callable[[Matrix, np.ndarray], Matrix]
) -> Matrix:
    """Return what a carrier's pose makes of the vectors of its cables, (3, m): one rotation a carrier."""
    columns: dict[int, Matrix] = {}
    owner = robot.carrier_of_cable
    for carrier in np.unique(owner).tolist():
        its = np.flatnonzero(owner == carrier)
        moved = move(carrier_pose[carrier, :].T, vectors[its])
        columns |= dict(zip(its.tolist(), ca.horzsplit(moved), strict=True))
    return ca.horzcat(*(columns[i] for i in range(len(vectors))))


def cables(robot: Robot, pose: Matrix, anchor_points: Matrix, axis_directions: Matrix) -> Exit:
    """Return the `Exit` of the cables, in the frame of `pose` (6, 1), anchors (3, m) and axes (3, m)."""
    return exit_points(anchor_points, axis_directions, robot.pulley_radii, transform(pose, robot.attachments))


def wrench_matrix(robot: Robot, pose: Matrix, directions: Matrix) -> Matrix:
    """Return A, (6, m): force [N per N] and moment about the CoM [N m per N] of each cable, in the frame of `pose`."""
    arms = rotation(pose[3:6]) @ ca.DM((robot.attachments - np.array(robot.platform.com)).T)  # (3, m)
    return ca.vertcat(directions, ca.cross(arms, directions, 1))


def cable_wrench(robot: Robot, pose: Matrix, run: Exit, tensions: Matrix) -> Matrix:
    """Return A t, (6, 1), for tensions t (m, 1) [N]: force [N] and moment about the CoM [N m].

    Each tension is over its cable's length before its moment is taken: second derivatives then take 0.7 of the
    operations of those of A t.
    """
    R, com = rotation(pose[3:6]), np.array(robot.platform.com)
    arms = R @ ca.DM((robot.attachments - com).T)  # (3, m)
    spans = run.points - (pose[0:3] + R @ ca.DM(com)) - arms
    lengths = ca.sqrt(ca.sum1(spans**2))
    forces = ca.horzcat(
        *(
            run.directions[:, i] * tensions[i] if radius else spans[:, i] * (tensions[i] / lengths[i])
            for i, radius in enumerate(robot.pulley_radii)
        )
    )
    return ca.vertcat(ca.sum2(forces), ca.sum2(ca.cross(arms, forces, 1)))
