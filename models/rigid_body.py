"""Newton and Euler for the platform in {G}: the wrench that its motion needs, the air's wrench, and accelerations.

    force  : m (a_c - g)                       a_c = ddx + alpha x R c + omega x (omega x R c)
    moment : I alpha + omega x I omega         I = R I_b R^T, omega = R Omega, alpha = R (dP dTheta + P ddTheta)

about the CoM, whose position in the platform frame is c. Source: paper F, Eqs. 24 and 29; paper C,
Eq. 4, which omits the gyroscopic term, and Eq. 12, which takes ddTheta for the angular acceleration.

A load that the platform carries needs the same about its own CoM, and the moment of its force about the platform's.

The air's wrench follows paper F,

    F_x = 1/2 rho C_d S V_x |V_x|,  F_y alike,  F_z = 1/2 rho C_l S (V_x^2 + V_y^2),  no moment about the CoM

where V is the air's velocity relative to the platform's CoM, along the axes of {G}. Eq. 25 has V_x^2 for
V_x |V_x| and so never pushes backwards; that form is kept under `form: printed`.

The wrench that a motion needs is affine in the accelerations, w = M(q) ddq + h(q, dq), so

    platform   M ddq = A t + W_e - h
    carrier    F = - sum_i t_i u_i,   M = - sum_i (c_i x R_Q^T u_i) t_i       (M in its own axes)

for the pull (F, M) of the cables i that a carrier holds, which leave it at c_i: what pulls the platform pulls the
carrier back (`carriers` has how a quadrotor moves with it).
"""

import casadi as ca
import numpy as np

from ..base.errors import InputError
from .cables.pulley import Exit
from .robot import Robot
from .rotation import Matrix, body_rate, rotation, turning


def com_velocity(robot: Robot, pose: Matrix, velocity: Matrix) -> Matrix:
    """Return the velocity of the CoM, (3, 1), in {G} [m/s]."""
    R = rotation(pose[3:6])
    omega = R @ body_rate(pose[3:6], velocity[3:6])
    return velocity[0:3] + ca.cross(omega, R @ ca.DM(robot.platform.com))


def inertial_wrench(robot: Robot, pose: Matrix, velocity: Matrix, acceleration: Matrix) -> Matrix:
    """Return w, (6, 1): force [N] and moment about the CoM [N m] in {G} against inertia and gravity.

    The motion is (x, y, z, roll, pitch, yaw) of the platform frame in {G} and its two time derivatives, (6, 1) each.
    """
    return body_wrench(*body_of(robot), ca.DM(robot.gravity), pose, velocity, acceleration)


def carried_wrench(robot: Robot, load: Matrix, pose: Matrix, velocity: Matrix, acceleration: Matrix) -> Matrix:
    """Return the wrench, (6, 1), that a load fixed to the platform needs, in {G}: [N], [N m] about the platform's CoM.

    The load is its mass [kg], CoM in the platform frame (3) [m] and inertia about it (Ixx, Iyy, Izz, Ixy, Ixz, Iyz)
    [kg m^2], (10, 1); motion as in `inertial_wrench`.
    """
    mass, com = load[0], load[1:4]
    xx, yy, zz, xy, xz, yz = (load[i] for i in range(4, 10))
    inertia = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    own = body_wrench(mass, com, inertia, ca.DM(robot.gravity), pose, velocity, acceleration)
    arm = rotation(pose[3:6]) @ (com - ca.DM(robot.platform.com))
    return ca.vertcat(own[0:3], own[3:6] + ca.cross(arm, own[0:3]))


def body_of(robot: Robot) -> tuple[float, Matrix, Matrix]:
    """Return mass [kg], CoM in the platform frame (3, 1) [m] and inertia about it (3, 3) [kg m^2] of the platform."""
    return robot.platform.mass, ca.DM(robot.platform.com), ca.DM(robot.inertia)


def body_wrench(
    mass: Matrix | float,
    com: Matrix,
    inertia: Matrix,
    gravity: Matrix,
    pose: Matrix,
    velocity: Matrix,
    acceleration: Matrix,
) -> Matrix:
    """Return the wrench, (6, 1), that a body needs about its CoM, which like its inertia is given in a moving frame."""
    R, Omega, alpha = turning(pose, velocity, acceleration)
    # In the body's own frame, whose inertia is constant: in {G} second derivatives take twice the operations.
    of_com = ca.cross(alpha, com) + ca.cross(Omega, ca.cross(Omega, com))
    moment = inertia @ alpha + ca.cross(Omega, inertia @ Omega)
    return ca.vertcat(mass * (acceleration[0:3] + R @ of_com - gravity), R @ moment)


def aerodynamic_wrench(robot: Robot, pose: Matrix, velocity: Matrix, wind: Matrix) -> Matrix:
    """Return W_e, (6, 1): force [N] and moment about the CoM [N m] of the air on the platform, in {G}.

    Pose and velocity, (6, 1) each, are of the platform frame in {G}; wind (3, 1) is the air's velocity there [m/s].
    Raises `InputError` if the robot's file has no `platform.aero`.
    """
    aero = robot.platform.aero
    if aero is None:
        raise InputError(f"wind must be left out for robot {robot.name!r}, which has no platform.aero")
    V = wind - com_velocity(robot, pose, velocity)
    pressure_area = 0.5 * aero.air_density * aero.area
    along = V[0:2] ** 2 if aero.form == "printed" else V[0:2] * ca.fabs(V[0:2])
    lift = pressure_area * aero.lift * (V[0] ** 2 + V[1] ** 2)
    return ca.vertcat(pressure_area * aero.drag * along, lift, ca.DM.zeros(3))


def platform_acceleration(robot: Robot, pose: Matrix, velocity: Matrix, wrench: Matrix) -> Matrix:
    """Return ddq, (6, 1), of the platform under gravity and `wrench` (6, 1): force and moment about the CoM in {G}.

    Coordinates that are not in `platform.dof` do not accelerate.
    """
    acceleration = ca.SX.sym("acceleration", 6)
    needed = inertial_wrench(robot, pose, velocity, acceleration)  # M ddq + h
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
