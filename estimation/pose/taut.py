"""Poses in which the cables can hold the weight at rest, since measured cables are taut."""

import numpy as np

from ...models.dynamics import dynamics_of
from ...models.robot import Robot

PULL = 0.03  # of the weight: a pose is off by the noise of its lengths, and so are the tensions that hold it


def taut(robot: Robot, poses: np.ndarray, carrier_pose: np.ndarray | None) -> np.ndarray:
    """Return whether non-negative tensions hold the weight at rest, (N,), for poses (N, 6)."""
    if robot.weight == 0.0:
        return np.ones(len(poses), bool)
    dynamics, still = dynamics_of(robot), np.zeros(6)
    rows = np.flatnonzero(robot.dof_mask)
    A = (dynamics.wrench_matrix(poses, carrier_pose) * robot.wrench_scale[:, None])[:, rows]
    w = (dynamics.required_wrench(poses, still, still) * robot.wrench_scale)[:, rows]
    if robot.m == len(rows):
        regular = np.abs(np.linalg.det(A)) > 1e-12
        tensions = np.linalg.solve(np.where(regular[:, None, None], A, np.eye(robot.m)), w[..., None])[..., 0]
        return regular & (tensions >= -PULL * robot.weight).all(axis=1)
    from scipy.optimize import nnls

    missing = [nnls(*balance)[1] for balance in zip(A, w, strict=True)]
    return np.array(missing) <= PULL * robot.weight
