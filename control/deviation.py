"""`Deviation`: whether platforms are away from their reference, so far that no step may be called as planned.

The largest distance is also the position error with which a simulation passes by default (`tolerance_of`).
"""

import numpy as np

from ..base.inputs import number
from ..models.points import rotations
from ..models.robot import Robot
from .controller import OFF, PLANNED, SHIFTED

FAR, MOST = 0.05, 0.05  # position: share of the mean length of the cables at home, and at most [m]
TURNED = 0.5  # [rad], of the rotation between the two
END, END_MOST, END_TURNED = 0.02, 0.1, 0.1  # the same for errors at the end of a prediction
LEFT = 0.5  # share of a larger error that a prediction may leave
END_FAR = 5.0  # times these: errors that are too large to decay within a prediction


class Deviation:
    """Compare measured poses of platforms with their references.

    `robot`: the robot.
    """

    def __init__(self, robot: Robot):
        length = float(np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1).mean())
        self.most = min(FAR * length, MOST), TURNED  # [m, rad]
        self._end = np.repeat([min(END * length, END_MOST), END_TURNED], 3)

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

        Very large errors, which are reported in any case, do not count.
        """
        first, last = np.linalg.norm(errors[[0, -1]] / self._end, axis=1)
        most = LEFT * first if first > 1 else 1.0
        return bool(last > most and first <= END_FAR)

    def status(self, answered: np.ndarray, poses: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Return the status of each platform, (N,), from its tensions' status; poses and references are (N, 6)."""
        far = self.are_far(poses, wanted) & ((answered == PLANNED) | (answered == SHIFTED))
        return np.where(far, OFF, answered).astype(np.int8) if far.any() else answered


def tolerance_of(robot: Robot, given: float | None) -> float:
    """Return the given tolerance [m], or by default 50 mm, of small robots 5 % of the mean cable length at home.

    Raises `InputError` if the given one is not a number from 0 to 1e6.
    """
    if given is not None:
        return number("tolerance", given, 0.0, 1e6)
    return Deviation(robot).most[0]
