"""A robot's forward kinematics with common carrier poses, or one set per platform pose: descents in the core."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ...core import pose_from_lengths as descend
from ...models.record import record_of
from ...models.robot import Robot
from .estimate import gradient

DAMPING = 1e-3  # of a first step from afar
MILD = 3.0  # largest ratio of weights in a descent from afar
OPEN = 1e-6  # of the gradient of the lengths, a singular value that is zero, relative to the largest


class Problem(NamedTuple):
    """The geometry of a robot with common carrier poses, or one set per platform pose."""

    # the robot, and its format in the core
    robot: Robot
    record: np.ndarray
    carriers: np.ndarray  # poses of the carriers, (c, 6), or (N, c, 6) for N poses of the platform
    free: np.ndarray  # 1 for coordinates that move, else 0, (6,)
    home: np.ndarray  # initial pose of the platform, (6,) [m, rad]
    freedoms: int  # number of coordinates that move
    open: bool  # True if the lengths do not determine the pose at home, as with parallel cables, so that gravity does

    def of(self, rows: np.ndarray) -> Problem:
        """Return the problem of some of the poses."""
        return self if self.carriers.ndim == 2 else self._replace(carriers=self.carriers[rows])

    def descend(
        self,
        lengths: np.ndarray,
        weights: np.ndarray,
        poses: np.ndarray,
        damping: float,
        free: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Descend from `poses` to the poses that fit measured lengths best.

        - `lengths`: (N, m) [m].
        - `weights`: weight of each cable's error, (m,).
        - `poses`: initial poses, (N, 6).
        - `damping`: lambda of the first step; 0 if the initial pose is close.
        - `free`: 1 for coordinates that move in this descent; default: all that the platform has.

        Returns poses (N, 6), weighted errors (N, m) [m], and whether each descent ended at a minimum, (N,).
        """
        moved, errors, steps = np.array(poses, order="C"), np.empty(lengths.shape), np.empty(len(lengths))
        free = self.free if free is None else free
        measured = np.ascontiguousarray(lengths)
        descend(self.record, self.carriers, measured, weights, free, np.array(damping), moved, errors, steps)
        return moved, errors, steps > 0.0

    def descend_from_afar(
        self, lengths: np.ndarray, weights: np.ndarray, poses: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Descend like `descend`, from distant poses.

        Very different weights cause a narrow curved valley, in which a descent stops, so it begins with `milder` ones.
        """
        mild = self.milder(weights)
        if (mild < weights).any():
            return self.descend(lengths, weights, self.descend(lengths, mild, poses, DAMPING)[0], 0.0)
        return self.descend(lengths, weights, poses, DAMPING)

    def milder(self, weights: np.ndarray) -> np.ndarray:
        """Return weights, (m,), limited relative to those of the cables that are needed to determine the pose."""
        return np.minimum(weights, MILD * np.sort(weights)[max(self.robot.m - self.freedoms, 0)])


def problem_of(robot: Robot, carrier_pose: np.ndarray | None = None) -> Problem:
    """Return the problem of a robot with its carriers at home, or at (c, 6) or (N, c, 6)."""
    problem = _at_home(robot)
    if carrier_pose is None:
        return problem
    return problem._replace(carriers=np.ascontiguousarray(carrier_pose))


@lru_cache(maxsize=16)
def _at_home(robot: Robot) -> Problem:
    J = gradient(robot, robot.home, None)[:, robot.dof_mask > 0.0]
    values = np.linalg.svd(J * robot.wrench_scale[robot.dof_mask > 0.0], compute_uv=False)
    is_open = robot.m < J.shape[1] or bool(values[-1] < OPEN * values[0])
    of_robot = robot, record_of(robot), robot.carrier_home, robot.dof_mask, robot.home
    return Problem(*of_robot, J.shape[1], is_open)
