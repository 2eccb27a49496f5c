"""`Reference`: the desired motion and tensions of a robot at one time."""

from typing import NamedTuple

import numpy as np

from ..base.display import record
from ..models.rigid_load import RigidLoad


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
