"""`PoseTracker`: the pose of a moving platform from a stream of cable lengths."""

import os

import numpy as np
from numpy.typing import ArrayLike

from ...base.display import Displayed
from ...base.errors import InputError
from ...base.inputs import finite_array
from ...models.batch import as_array
from ...models.files import as_robot
from ...models.robot import Robot
from .estimate import PoseEstimate
from .from_lengths import SIGMA, checked_lengths, checked_sigma, one_pose, pose_from_lengths


class PoseTracker(Displayed):
    """Track a platform: each estimate starts from the previous one, and a search starts if the result does not fit.

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
        Number of searches.

    Raises
    ------
    InputError
        If an argument has a wrong shape or value.
    """

    def __init__(self, robot: Robot | str | os.PathLike[str], start: ArrayLike | None = None, sigma: ArrayLike = SIGMA):
        self.robot, self.searches = as_robot(robot), 0
        self.sigma = checked_sigma(sigma, self.robot.m)
        self.pose = None if start is None else finite_array("start", start, (6,)).copy()

    def update(self, lengths: ArrayLike, carrier_pose: ArrayLike | None = None) -> PoseEstimate:
        """Return the estimate for the next lengths, (m,) [m], with carriers at `carrier_pose`, (c, 6), or at home.

        Raises
        ------
        InputError
            If an argument has a wrong shape or value.
        """
        measured, carriers = one_pose(lengths, carrier_pose, self.robot)
        estimate = None
        if self.pose is not None:
            estimate = pose_from_lengths(self.robot, measured, self.pose, carriers, self.sigma)
        if estimate is None or not estimate.consistent:
            self.searches += 1
            estimate = pose_from_lengths(self.robot, measured, None, carriers, self.sigma)
        if estimate.consistent:
            self.pose = estimate.pose.copy()
        return estimate

    def follow(self, lengths: ArrayLike, carrier_pose: ArrayLike | None = None) -> np.ndarray:
        """Return the poses, (N, 6), of a stream of lengths (N, m).

        Carriers are at `carrier_pose`, (N, c, 6), or (c, 6) if they do not move; default: at home.

        Raises
        ------
        InputError
            If an argument has a wrong shape or value.
        """
        rows = checked_lengths(lengths, self.robot)
        if rows.ndim != 2:
            raise InputError(f"lengths must have the shape (N, {self.robot.m}), got {rows.shape}")
        places = [None] * len(rows)
        if carrier_pose is not None:
            home = self.robot.carrier_home
            carriers = as_array("carrier_pose", carrier_pose, home.shape)
            if carriers.shape[:-2] not in ((), (len(rows),)):
                accepted = f"{home.shape} or {(len(rows), *home.shape)}"
                raise InputError(f"carrier_pose must have the shape {accepted}, got {carriers.shape}")
            places = list(np.broadcast_to(carriers, (len(rows), *home.shape)))
        poses = [self.update(row, place).pose for row, place in zip(rows, places, strict=True)]
        return np.array(poses).reshape(-1, 6)
