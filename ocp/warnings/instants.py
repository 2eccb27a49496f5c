"""`Instants`: the instants of a motion that warnings are about."""

from functools import cached_property

import numpy as np

from ...models import Dynamics, Robot, points


class Instants:
    """Compute where the parts of a robot are at some instants of its motion, in {G}.

    Parameters
    ----------
    dynamics
        Of the robot.
    times
        (n,) [s].
    pose, carriers
        Poses of the platform, (n, 6), and of the carriers, (n, c, 6) [m, rad].
    """

    def __init__(self, dynamics: Dynamics, times: np.ndarray, pose: np.ndarray, carriers: np.ndarray):
        self._dynamics, self.times, self._pose, self.carriers = dynamics, times, pose, carriers

    @property
    def robot(self) -> Robot:
        """Return the robot."""
        return self._dynamics.robot

    @cached_property
    def anchors(self) -> np.ndarray:
        """Return the anchors, (n, m, 3) [m]."""
        return points.anchors(self.robot, self.carriers)

    @cached_property
    def platform(self) -> np.ndarray:
        """Return the CoM of the platform and its attachments, (n, 1 + m, 3) [m]."""
        return points.placed(self._pose, np.vstack([self.robot.platform.com, self.robot.attachments]))

    @property
    def home_lengths(self) -> np.ndarray:
        """Return the lengths of the cables at home, (m,) [m]."""
        return self._dynamics.cable_lengths(self.robot.home)

    @cached_property
    def lengths(self) -> np.ndarray:
        """Return the lengths of the cables, (n, m) [m]."""
        return self._dynamics.cable_lengths(self._pose, self.carriers)
