"""`Motion`: poses over time and their derivatives."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ....base.display import record


class Motion(NamedTuple):
    """Poses over time and their derivatives; times come first, coordinates (x, y, z, roll, pitch, yaw) last.

    Where a path is taken as a curve, the fraction s of it stands for the time and derivatives are by s.
    """

    pose: np.ndarray  # (n, 6) [m, rad]
    velocity: np.ndarray  # (n, 6) [m/s, rad/s]
    acceleration: np.ndarray  # (n, 6) [m/s^2, rad/s^2]

    __repr__ = record

    @classmethod
    def still(cls, pose: np.ndarray) -> Motion:
        """Return poses (n, 6) at rest."""
        return cls(pose, np.zeros_like(pose), np.zeros_like(pose))

    def plus(self, deviation: Iterable[np.ndarray]) -> Motion:
        """Add a deviation of pose, velocity and acceleration, coordinate by coordinate."""
        return Motion(*(mine + its for mine, its in zip(self, deviation, strict=True)))

    def timed(self, sd: np.ndarray | float, sdd: np.ndarray | float) -> Motion:
        """Return the motion over time of a curve by s, from ds/dt [1/s] and d2s/dt2 [1/s^2] at its points, (n,)."""
        shape = (-1, *[1] * (self.pose.ndim - 1))
        sd, sdd = np.reshape(sd, shape), np.reshape(sdd, shape)
        return Motion(self.pose, self.velocity * sd, self.velocity * sdd + self.acceleration * sd**2)
