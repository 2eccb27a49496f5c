"""`PoseTracker`: the pose of a moving platform from a stream of cable lengths."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import ArrayLike

from ...inputs import finite_array
from ..files import as_robot
from ..robot import Robot
from .estimate import PoseEstimate
from .from_lengths import SIGMA, pose_from_lengths
from .machine import load

__all__ = ["PoseTracker"]


class PoseTracker:
    """Follow a platform: each estimate starts from the one before, and a search begins where that does not fit.

    Parameters
    ----------
    robot
        A `Robot`, the name of one in the library, or the path of a robot file.
    start
        Pose before the first lengths, (6,) [m, rad]; default: a search.
    sigma
        Standard deviations of the lengths [m], one number or (m,).

    Attributes
    ----------
    pose
        The last pose that fits its lengths, (6,), or None.
    searches
        How often it had to search.

    Raises
    ------
    InputError
        If an argument has a wrong shape or value.
    """

    def __init__(self, robot: Robot | str | os.PathLike[str], start: ArrayLike | None = None, sigma: ArrayLike = SIGMA):
        self.robot, self.sigma, self.searches = as_robot(robot), sigma, 0
        self.pose = None if start is None else finite_array("start", start, (6,))
        load()  # now, not amid a stream

    def update(self, lengths: ArrayLike, carrier_pose: ArrayLike | None = None) -> PoseEstimate:
        """Return the estimate of the next lengths, (m,) [m], with carriers at `carrier_pose`, (c, 6), or at home.

        Raises
        ------
        InputError
            If an argument has a wrong shape or value.
        """
        if self.pose is not None:
            estimate = pose_from_lengths(self.robot, lengths, self.pose, carrier_pose, self.sigma)
            if estimate.consistent:
                self.pose = estimate.pose
                return estimate
        self.searches += 1
        estimate = pose_from_lengths(self.robot, lengths, None, carrier_pose, self.sigma)
        if estimate.consistent:
            self.pose = estimate.pose
        return estimate

    def follow(self, lengths: ArrayLike, carrier_pose: ArrayLike | None = None) -> np.ndarray:
        """Return the poses, (N, 6), of a stream of lengths (N, m), with carriers at `carrier_pose`, (N, c, 6), or home.

        Raises
        ------
        InputError
            If an argument has a wrong shape or value.
        """
        rows = np.asarray(lengths)
        places = [None] * len(rows) if carrier_pose is None else list(np.asarray(carrier_pose))
        return np.array([self.update(row, place).pose for row, place in zip(rows, places, strict=True)])
