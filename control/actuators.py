"""`actuators`: what the actuators of carriers do, as arrays for `thrusts`."""

from __future__ import annotations

import numpy as np

from ..models.robot import Robot

__all__ = ["actuators"]


def actuators(robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what actuators do: commands for units of force and moment on each carrier, (c, a, 6), limits, and forces.

    The limits of commands are (2, c, a), the forces in the carriers' axes for units of commands (c, a, 3).
    """
    most = max(len(carrier.actuators) for carrier in robot.carriers)
    inverses, limits = np.zeros((len(robot.carriers), most, 6)), np.zeros((2, len(robot.carriers), most))
    forces = np.zeros((len(robot.carriers), most, 3))
    for index, carrier in enumerate(robot.carriers):
        if own := carrier.actuators:
            inverses[index, : len(own)] = np.linalg.pinv(np.array([each.wrench for each in own]).T)
            limits[:, index, : len(own)] = np.array([(each.low, each.high) for each in own]).T
            forces[index, : len(own)] = np.array([each.wrench[:3] for each in own])
    return inverses, limits, forces
