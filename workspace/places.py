"""Where the platform and its carriers are, many times: `Places`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..models import Robot

__all__ = ["Places"]


@dataclass(frozen=True, eq=False)
class Places:
    """Where platform and carriers are, n times.

    Attributes
    ----------
    pose
        (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (n, 6).
    carriers
        The same of each carrier, (n, c, 6).
    """

    pose: np.ndarray  # (n, 6)
    carriers: np.ndarray  # (n, c, 6)

    @classmethod
    def at_home(cls, robot: Robot, pose: ArrayLike) -> Places:
        """Poses (n, 6) in {G} [m, rad] with every carrier at home."""
        poses = np.atleast_2d(np.asarray(pose, dtype=float))
        home = robot.carrier_home
        return cls(poses, np.broadcast_to(home, (len(poses), *home.shape)))

    def __len__(self) -> int:
        return len(self.pose)

    def only(self, rows: np.ndarray | slice) -> Places:
        """The places of some rows: indices, flags (n,) or a slice."""
        return Places(self.pose[rows], self.carriers[rows])
