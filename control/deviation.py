"""`Deviation`: whether platforms are away from their reference, so far that no step may be called as planned."""

import numpy as np

from ..models.robot import Robot
from .command import OFF, PLANNED, SHIFTED

FAR = 0.1  # of the mean length of the cables at home: position
TURNED = 0.5  # [rad], each of roll, pitch and yaw


class Deviation:
    """Compare measured poses of platforms with their references.

    `robot`: the robot.
    """

    def __init__(self, robot: Robot):
        lengths = np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1)
        self.most = FAR * float(lengths.mean()), TURNED  # [m, rad]

    def are_far(self, poses: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return which poses (..., 6) are away from their references (..., 6)."""
        with np.errstate(over="ignore", invalid="ignore"):
            off = poses - wanted
            turned = np.abs((off[..., 3:] + np.pi) % (2 * np.pi) - np.pi).max(axis=-1) > TURNED
            return np.asarray((np.square(off[..., :3]).sum(axis=-1) > self.most[0] ** 2) | turned)

    def status(self, answered: np.ndarray, poses: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the status of each platform, (N,), from that of its tensions; poses and references are (N, 6)."""
        far = self.are_far(poses, wanted) & ((answered == PLANNED) | (answered == SHIFTED))
        return np.where(far, OFF, answered).astype(np.int8) if far.any() else answered
