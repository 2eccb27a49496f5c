"""`wrong_cables`: the cables of which one wrong length explains why no pose fits."""

from collections.abc import Sequence

import numpy as np

from ...models.dynamics import dynamics_of
from .estimate import PoseEstimate, largest_cost
from .from_lengths import pose_from_lengths

LEFT_OUT = 1e6  # [m], the standard deviation of a length that has no influence
MISSED = 1e-4  # probability that the wrong length alone is not found to explain the others
TOLD_APART = 4.0  # standard deviations by which one cable is more likely wrong than another


def can_explain(estimate: PoseEstimate) -> bool:
    """Return whether the lengths are redundant without any one of them."""
    return bool(estimate.robot.m > estimate.robot.dof_mask.sum() + 1)


def wrong_cables(estimate: PoseEstimate, rows: Sequence[int] | None = None) -> tuple[int, ...]:
    """Return the cables, from 0, of which one is most likely wrong in all rows; none if no single one explains them.

    Poses are fitted to the lengths without each cable. The linear test of `PoseEstimate.suspects` finds another cable
    for half of the errors that move the pose far.

    Args:
        estimate: One pose, or N poses, of a robot that satisfies `can_explain`.
        rows: Indices of some of N poses (default: the one pose).
    """
    robot, carriers = estimate.robot, estimate.carrier_pose
    poses, residuals = np.atleast_2d(estimate.pose), np.atleast_2d(estimate.residuals)
    if rows is not None:
        poses, residuals = poses[rows], residuals[rows]
        carriers = carriers[rows] if carriers is not None and carriers.ndim > 2 else carriers
    lengths = dynamics_of(robot).cable_lengths(poses, carriers) - residuals
    sigmas = np.where(np.eye(robot.m, dtype=bool), LEFT_OUT, estimate.sigma)
    costs = np.array([pose_from_lengths(robot, lengths, None, carriers, sigma).cost.sum() for sigma in sigmas])  # (m,)
    most = len(lengths) * largest_cost(robot.m - 1 - int(robot.dof_mask.sum()), MISSED)
    return tuple(np.flatnonzero(costs <= min(costs.min() + TOLD_APART**2, most)).tolist())
