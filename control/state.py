"""`State` and `Reference`: the measured and the desired state of a robot at one time."""

from typing import NamedTuple

import numpy as np

from ..base.display import record
from ..models.rigid_load import RigidLoad


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


class Reference(NamedTuple):
    """A reference at one time. If it is the same for a whole batch, its arrays may omit the leading dimension.

    Attributes:
        pose, velocity, acceleration: (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (..., 6), and
            its time derivatives.
        carrier_pose, carrier_velocity, carrier_acceleration: Pose of each carrier's frame in {G}, (..., c, 6), and its
            time derivatives.
        tensions: Planned tensions [N], (..., m); None if none are planned; the smallest tensions are then preferred.
        load: `RigidLoad` that the platform carries from this time on; None for no load.
    """

    pose: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    carrier_pose: np.ndarray
    carrier_velocity: np.ndarray
    carrier_acceleration: np.ndarray
    tensions: np.ndarray | None = None
    load: RigidLoad | None = None

    __repr__ = record
