"""`Reference`: where a robot should be at one time, how it should move, and with which tensions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.display import record


class Reference(NamedTuple):
    """A reference at one time. Its arrays may be without the leading dimension of a batch if it is the same for all.

    Attributes
    ----------
    pose, velocity, acceleration
        (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (..., 6), and its time derivatives.
    carrier_pose, carrier_velocity, carrier_acceleration
        The same of each carrier, (..., c, 6).
    tensions
        The planned tensions [N], (..., m); None if none are planned: the smallest inside the limits are best then.
    """

    pose: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    carrier_pose: np.ndarray
    carrier_velocity: np.ndarray
    carrier_acceleration: np.ndarray
    tensions: np.ndarray | None = None

    __repr__ = record
