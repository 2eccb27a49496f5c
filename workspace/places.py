"""Configurations of platform and carriers: `Places`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..base.display import Displayed
from ..base.inputs import InputError, real_array, required, shown
from ..models import Robot


@dataclass(frozen=True, eq=False)
class Places(Displayed):
    """n configurations: poses of platform and carriers.

    Attributes:
        pose: (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (n, 6).
        carriers: Pose of each carrier in {G}, (n, c, 6).
    """

    pose: np.ndarray  # (n, 6)
    carriers: np.ndarray  # (n, c, 6)

    @classmethod
    def at_home(cls, robot: Robot, pose: ArrayLike) -> Places:
        """Return the configurations of poses (n, 6) or (6,) in {G} [m, rad] with every carrier at home.

        At a pose with a number that is not finite no condition holds.

        Raises:
            InputError: If an argument has a wrong type or shape.
        """
        home = required("robot", robot, Robot).carrier_home
        poses = np.atleast_2d(real_array("pose", pose).astype(float, copy=False))
        if poses.ndim != 2 or poses.shape[1] != 6:
            raise InputError(f"pose must have the shape (n, 6), got {np.shape(pose)}")
        return cls(poses, np.broadcast_to(home, (len(poses), *home.shape)))

    def __len__(self) -> int:
        return len(self.pose)

    def only(self, rows: np.ndarray | slice) -> Places:
        """Return the configurations of some rows: indices, flags (n,) or a slice.

        Raises:
            InputError: If `rows` are none of these.
        """
        try:
            return Places(self.pose[rows], self.carriers[rows])
        except (IndexError, TypeError, ValueError):
            accepted = f"indices below {len(self)}, flags ({len(self)},) or a slice"
            raise InputError(f"rows must be {accepted}, got {shown(rows)}") from None


def check_places(robot: Robot, places: Places) -> None:
    """Check that these are a robot and its configurations; otherwise raise InputError."""
    parts = {"pose": required("places", places, Places).pose, "carriers": places.carriers}
    n, carriers = np.shape(places.pose)[:1], len(required("robot", robot, Robot).carriers)
    for (name, value), shape in zip(parts.items(), ((*n, 6), (*n, carriers, 6)), strict=True):
        if not isinstance(value, np.ndarray) or value.shape != shape or value.dtype.kind not in "fiu":
            raise InputError(f"places.{name} must be an array of numbers of shape {shape}, got {shown(value)}")
