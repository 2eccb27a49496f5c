"""Poses to begin with where none was measured: those that the lengths of the file's robot give."""

from __future__ import annotations

import numpy as np

from ..models import pose_from_lengths
from ..models.robot import Robot

SHORTEST = 1e-3  # [m]; readings without their offsets may be negative
FAR = 3.0  # times the median misfit: such poses are looked for elsewhere


def start_poses(robot: Robot, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (N, 6) [m, rad] whose lengths are nearest to `lengths` (N, m) [m], and how far they are (N,) [m].

    Where several poses have these lengths, the one near home is taken: a log seldom comes from far away.
    """
    positive = np.maximum(lengths, SHORTEST)
    near = pose_from_lengths(robot, positive, start=np.tile(robot.home, (len(lengths), 1)))
    poses, misfit = near.pose.copy(), near.residual.copy()
    bad = np.flatnonzero(~(misfit <= FAR * np.median(misfit)))
    if bad.size:
        other = pose_from_lengths(robot, positive[bad])
        better = other.residual < misfit[bad]
        poses[bad[better]], misfit[bad[better]] = other.pose[better], other.residual[better]
    return poses, misfit
