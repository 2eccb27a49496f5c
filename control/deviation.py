"""`Deviation`: whether platforms are away from their reference, so far that no step may be called as planned."""

import numpy as np

from ..models.points import rotations
from ..models.robot import Robot
from .command import OFF, PLANNED, SHIFTED

FAR, MOST = 0.1, 0.5  # position: of the mean length of the cables at home, and at most [m]
TURNED = 0.5  # [rad], of the rotation between the two
OFF_TARGET = 0.2  # of these: an error with which predictions may end
LEFT = 0.5  # of larger ones, how much they may leave


class Deviation:
    """Compare measured poses of platforms with their references.

    `robot`: the robot.
    """

    def __init__(self, robot: Robot):
        lengths = np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1)
        self.most = min(FAR * float(lengths.mean()), MOST), TURNED  # [m, rad]

    def are_far(self, poses: np.ndarray, wanted: np.ndarray, between: np.ndarray | None = None) -> np.ndarray:
        """Return which poses (..., 6) are away from their references (..., 6).

        `between` is the rotation from the one to the other, (..., 3, 3), if it is known.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            if between is None:
                trace = (rotations(poses[..., 3:]) * rotations(wanted[..., 3:])).sum(axis=(-1, -2))
            else:
                trace = between[..., 0, 0] + between[..., 1, 1] + between[..., 2, 2]
            away = np.square(poses[..., :3] - wanted[..., :3]).sum(axis=-1)
            return np.asarray((away > self.most[0] ** 2) | ((trace - 1.0) / 2 < np.cos(TURNED)))

    def stays(self, errors: np.ndarray) -> bool:
        """Return whether predicted errors, (K, 6) [m, rad], do not decrease, or will be more than negligible.

        Errors that are reported in any case do not count.
        """
        first, last = np.linalg.norm(errors[[0, -1]] / np.repeat(self.most, 3), axis=1)
        most = LEFT * first if first > OFF_TARGET else OFF_TARGET
        return bool(last > most and not self.are_far(errors[0], np.zeros(6)))

    def status(self, answered: np.ndarray, poses: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the status of each platform, (N,), from that of its tensions; poses and references are (N, 6)."""
        far = self.are_far(poses, wanted) & ((answered == PLANNED) | (answered == SHIFTED))
        return np.where(far, OFF, answered).astype(np.int8) if far.any() else answered
