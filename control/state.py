"""`State`: what sensors report of a robot at one time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.display import record


class State(NamedTuple):
    """A measured state. All arrays of a batch have the same leading dimension, or none for one robot.

    Attributes
    ----------
    pose, velocity
        (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (..., 6), and its time derivative.
    carrier_pose, carrier_velocity
        The same of each carrier, (..., c, 6).
    tensions
        Measured tensions [N], (..., m); None if the robot has no sensors for them.
    time
        When all of it was measured, on the clock of the steps [s]; default: now. The controllers of towline move an
        older state on to the time of their step, with the commands that were sent since.
    """

    pose: np.ndarray
    velocity: np.ndarray
    carrier_pose: np.ndarray
    carrier_velocity: np.ndarray
    tensions: np.ndarray | None = None
    time: float | None = None

    __repr__ = record
