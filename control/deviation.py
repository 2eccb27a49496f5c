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
        self._square = (FAR * float(lengths.mean())) ** 2

    def is_far(self, pose: np.ndarray, wanted: np.ndarray) -> bool:
        """Return whether a pose (6,) is away from its reference (6,); false for nan."""
        (x, y, z, a, b, c), (u, v, w, d, e, f) = pose.tolist(), wanted.tolist()
        x, y, z = x - u, y - v, z - w
        if x * x + y * y + z * z > self._square:
            return True
        if -TURNED <= a - d <= TURNED and -TURNED <= b - e <= TURNED and -TURNED <= c - f <= TURNED:
            return False
        return bool(self.are_far(pose, wanted))

    def are_far(self, poses: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return which poses (..., 6) are away from their references (..., 6)."""
        with np.errstate(over="ignore", invalid="ignore"):
            off = poses - wanted
            turned = np.abs((off[..., 3:] + np.pi) % (2 * np.pi) - np.pi).max(axis=-1) > TURNED
            return np.asarray((np.square(off[..., :3]).sum(axis=-1) > self._square) | turned)

    def status(self, answered: np.ndarray, poses: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the status of each platform, (N,), from that of its tensions; poses and references are (N, 6)."""
        if len(poses) == 1 and not self.is_far(poses[0], wanted[0]):
            return answered
        far = self.are_far(poses, wanted) & ((answered == PLANNED) | (answered == SHIFTED))
        return np.where(far, OFF, answered).astype(np.int8) if far.any() else answered
