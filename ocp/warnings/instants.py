"""`Instants`: the instants of a motion that warnings are about."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.display import Displayed
from ...models import Dynamics, Robot, points


@dataclass(frozen=True)
class Instants(Displayed):
    """Compute where the parts of a robot are at some instants of its motion, in {G}."""

    dynamics: Dynamics
    times: np.ndarray  # (n,) [s]
    pose: np.ndarray  # (n, 6) [m, rad], of the platform
    carriers: np.ndarray  # (n, c, 6) [m, rad]

    @property
    def robot(self) -> Robot:
        """Return the robot."""
        return self.dynamics.robot

    @cached_property
    def anchors(self) -> np.ndarray:
        """Return the anchors, (n, m, 3) [m]."""
        return points.anchors(self.robot, self.carriers)

    @cached_property
    def platform(self) -> np.ndarray:
        """Return the CoM of the platform and its attachments, (n, 1 + m, 3) [m]."""
        return points.placed(self.pose, np.vstack([self.robot.platform.com, self.robot.attachments]))
