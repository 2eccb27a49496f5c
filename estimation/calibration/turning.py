"""`turning`: how far a platform turns in a log, and so moves its attachments, which shows where they are.

Attachments are levers of the platform's rotations. If these move them by about as much as readings are wrong, what the
model lacks, such as the stretch of cables, looks like displaced attachments, however many samples there are.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...models.robot import Robot
from ..logs.measurements import Measurements, measured_poses

LEAST = 3.0  # standard deviations of a length, by which attachments must move to be estimated


class Turning(NamedTuple):
    """Standard deviations of the orientation over a log [rad], and of attachments because of it [m]."""

    angle: float
    shift: float
    enough: bool  # False if the shift is about as small as errors of lengths


def turning(robot: Robot, measurements: Measurements) -> Turning | None:
    """Return how far the platform turns, or None unless its orientations were measured and it can turn."""
    _, rotation, known = measured_poses(robot, measurements)
    rows = np.flatnonzero(known[:, 3:].all(axis=1))
    if len(rows) < 2 or not robot.dof_mask[3:].any():
        return None
    turned = Rotation.from_matrix(rotation[rows])
    away = (turned.mean().inv() * turned).as_rotvec()
    arms = robot.attachments - robot.attachments.mean(axis=0)
    shift = float(np.sqrt((np.cross(away[:, None], arms) ** 2).sum(axis=2).mean()))
    angle = float(np.sqrt((away**2).sum(axis=1).mean()))
    return Turning(angle, shift, shift >= LEAST * measurements.sigma.lengths)
