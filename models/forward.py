"""Forward dynamics: accelerations from tensions, of the platform, and the pull of its cables on the carriers.

The wrench that a motion needs is affine in the accelerations, w = M(q) ddq + h(q, dq), so

    platform   M ddq = A t + W_e - h
    carrier    F = - sum_i t_i u_i,   M = - sum_i (c_i x R_Q^T u_i) t_i       (M in its own axes)

for the pull (F, M) of the cables i that a carrier holds, which leave it at c_i: what pulls the platform pulls the
carrier back (`carriers` has how a quadrotor moves with it). Coordinates are (x, y, z, roll, pitch, yaw) and their
derivatives. Source: Newton and Euler.
"""

import casadi as ca
import numpy as np

from . import rigid_body
from .cables.pulley import Exit
from .robot import Robot
from .rotation import Matrix, rotation


def platform_acceleration(robot: Robot, pose: Matrix, velocity: Matrix, wrench: Matrix) -> Matrix:
    """Return ddq, (6, 1), of the platform under gravity and `wrench` (6, 1): force and moment about the CoM in {G}.

    Coordinates that are not in `platform.dof` do not accelerate.
    """
    acceleration = ca.SX.sym("acceleration", 6)
    needed = rigid_body.inertial_wrench(robot, pose, velocity, acceleration)  # M ddq + h
    M, h = ca.jacobian(needed, acceleration), ca.substitute(needed, acceleration, ca.DM.zeros(6))
    rows = [int(i) for i in np.flatnonzero(robot.dof_mask)]
    moving = ca.solve(M[rows, rows], (wrench - h)[rows])
    return ca.DM.eye(6)[:, rows] @ moving


def pull_on_carrier(robot: Robot, index: int, run: Exit, carrier_pose: Matrix, tensions: Matrix) -> Matrix:
    """Return the pull of its cables on carrier `index`, (6, 1): force in {G} [N], moment in its own axes [N m].

    The cables run in {G} as `run` has it: over a pulley one pulls along the line that leaves the sheave. The carrier
    is at `carrier_pose` in {G}, (6, 1).
    """
    R = rotation(carrier_pose[3:6])
    force, moment = ca.DM.zeros(3), ca.DM.zeros(3)
    for cable in np.flatnonzero(robot.carrier_of_cable == index):
        i = int(cable)
        along = -tensions[i] * run.directions[:, i]
        force = force + along
        moment = moment + R.T @ ca.cross(run.points[:, i] - carrier_pose[0:3], along)
    return ca.vertcat(force, moment)
