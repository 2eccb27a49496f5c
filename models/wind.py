"""The aerodynamic wrench of paper F on the platform.

    F_x = 1/2 rho C_d S V_x |V_x|,  F_y alike,  F_z = 1/2 rho C_l S (V_x^2 + V_y^2),  no moment about the CoM

V is the air's velocity relative to the platform's CoM, along the axes of {G}. Source: paper F, Eq. 25, which has V_x^2
for V_x |V_x| and so never pushes backwards; that form is kept under `form: printed`.
"""

import casadi as ca

from ..base.errors import InputError
from .rigid_body import com_velocity
from .robot import Robot
from .rotation import Matrix


def aerodynamic_wrench(robot: Robot, pose: Matrix, velocity: Matrix, wind: Matrix) -> Matrix:
    """Return W_e, (6, 1): force [N] and moment about the CoM [N m] of the air on the platform, in {G}.

    Pose and velocity, (6, 1) each, are of the platform frame in {G}; wind (3, 1) is the air's velocity there [m/s].
    Raises `InputError` if the robot's file has no `platform.aero`.
    """
    aero = robot.platform.aero
    if aero is None:
        raise InputError(f"wind must be left out for robot {robot.name!r}, which has no platform.aero, got a wind")
    V = wind - com_velocity(robot, pose, velocity)
    pressure_area = 0.5 * aero.air_density * aero.area
    along = V[0:2] ** 2 if aero.form == "printed" else V[0:2] * ca.fabs(V[0:2])
    lift = pressure_area * aero.lift * (V[0] ** 2 + V[1] ** 2)
    return ca.vertcat(pressure_area * aero.drag * along, lift, ca.DM.zeros(3))
