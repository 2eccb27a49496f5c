"""How a plant is driven and stepped by default: `default_drive`, and `steps_in`, Runge-Kutta steps per period."""

import math

import numpy as np

from ..models.dynamics import dynamics_of
from ..models.part import inertia_matrix
from ..models.robot import Robot
from .plant import Plant

ANGLE = 1.0  # what the fastest motion of the cables may turn or decay by in a step; Runge-Kutta is stable up to 2.8


def default_drive(robot: Robot) -> str:
    """Return the type of command of a robot's plant unless another is chosen, see `Plant`."""
    if all(cable.winch is not None for cable in robot.cables):
        return "forces"
    if robot.fixed_lengths is not None:
        return "lengths"
    return "lengths" if all(cable.stiffness for cable in robot.cables) else "tensions"


def steps_in(period: float, plant: Plant) -> int:
    """Return the number of steps per period [s] that resolves the fastest motion of elastic cables."""
    return max(1, math.ceil(period * fastest_motion(plant) / ANGLE))


def fastest_motion(plant: Plant) -> float:
    """Return the fastest motion of elastic cables at the robot's home [rad/s]; 0 if not all of them are elastic.

    With the elongations e of taut cables, d2e/dt2 = -G (K e + C de/dt), where G has the accelerations along the cables
    that unit tensions cause; the largest eigenvalues of G K and G C bound frequency and decay.
    """
    cables = plant.record["cable"][: plant.robot.m]
    stiffness, damping = cables["stiffness"], cables["damping"]
    if plant.drive == "tensions" or not stiffness.all():
        return 0.0
    robot = plant.robot
    A, mask = dynamics_of(robot).wrench_matrix(robot.home, robot.carrier_home), robot.dof_mask
    inverse = np.zeros((6, 6))
    inverse[:3, :3] = np.eye(3) / robot.platform.mass
    inverse[3:, 3:] = np.linalg.pinv(robot.inertia)
    A = A * mask[:, None]
    G = A.T @ inverse @ A
    for index, carrier in enumerate(robot.carriers):
        if carrier.body is not None:
            its = robot.carrier_of_cable == index
            u = A[:3] * its
            arms = (robot.home_anchors - robot.carrier_home[index, :3]).T * its
            moments = np.cross(arms, u, axis=0)
            G += u.T @ u / carrier.body.mass
            G += moments.T @ np.linalg.solve(inertia_matrix(carrier.body.inertia), moments)
    lengths = np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1)
    frequency = math.sqrt(float(np.abs(np.linalg.eigvals(G * (stiffness / lengths))).max()))
    decay = float(np.abs(np.linalg.eigvals(G * damping)).max())
    return max(frequency, decay)
