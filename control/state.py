"""`State`: the measured state of a robot at one time."""

from typing import NamedTuple

import numpy as np

from ..base.display import record


class State(NamedTuple):
    """A measured state. All arrays of a batch have the same leading dimension, or none for one robot.

    Attributes:
        pose, velocity: (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (..., 6), and its time
            derivative.
        carrier_pose, carrier_velocity: Pose of each carrier's frame in {G}, (..., c, 6), and its time derivative.
        tensions: Measured tensions [N], (..., m); None if the robot has no tension sensors.
        time: Time of the measurement on the clock of the steps [s] (default: now). The controllers of towline predict
            the current state from an older one and the commands that were sent since.
    """

    pose: np.ndarray
    velocity: np.ndarray
    carrier_pose: np.ndarray
    carrier_velocity: np.ndarray
    tensions: np.ndarray | None = None
    time: float | None = None

    __repr__ = record
