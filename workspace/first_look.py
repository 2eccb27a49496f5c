"""A first look at the workspace: random positions about home, and whether the robot can rest there."""

from __future__ import annotations

import numpy as np

from ..distribution import pose_problem
from ..models import Dynamics
from ..solvers import solve
from .region import surrounding_box


def hints(dynamics: Dynamics, count: int = 400, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A first look at the workspace: random positions about home and whether the robot can rest there.

    The positions fill the box of home, anchors and carriers at random, by `seed`, at the attitude of home. For the
    workspace itself, with volumes and conditions, this is no substitute.

    Returns
    -------
    Positions (count, 3) [m] and flags (count,).
    """
    robot = dynamics.robot
    low, high = surrounding_box(robot, {})
    poses = np.tile(robot.home, (count, 1))
    poses[:, :3] = low + np.random.default_rng(seed).uniform(size=(count, 3)) * (high - low)
    feasible = np.array([solve(pose_problem(dynamics, pose)).feasible for pose in poses])
    return poses[:, :3], feasible
