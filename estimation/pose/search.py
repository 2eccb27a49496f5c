"""Poses from lengths without a start: descents from several attitudes until one fits.

The level platform with the given lengths, and home, are often close to the true pose, so the search starts there. Rows
that do not fit exactly continue from the level platform turned by 45 and 90 degrees about one axis. If several poses
fit, the most likely one is returned, with a standard deviation of 30 degrees of angles about home. With as many cables
as coordinates many poses fit, so six cables continue from turns about oblique axes. Poses in which the cables can hold
the weight are preferred. The others still make the result ambiguous, because CoM and load are not exact.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from ...core import pose_from_lengths as descend
from ...models import points
from ...models.record import record_of
from ...models.robot import Robot
from .estimate import EXACT, PoseEstimate, gradient, largest_cost, taut
from .residual_tests import squares_of

TURNS = np.radians([45.0, 90.0])
OBLIQUE = np.radians([60.0, 25.0])  # about an axis between two, for platforms that have many poses with their lengths
USUAL = np.radians(30.0)  # standard deviation of the angle from home, where several poses fit
APART = 0.02  # in radians, and times the platform's size: poses that are not one
RARE = 1e-4  # share of sound measurements that fit no better than the least likely pose that counts as ambiguous
MISFIT = 1e12  # beyond the score of any pose that fits
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


class _Best:
    """The best poses so far.

    - `poses`, `errors`, `ended`: (N, 6), (N, m) in standard deviations, and whether they are minima, (N,).
    - `ambiguous`: True if another pose fits too, held by the cables or not, (N,).
    - `left`: rows that need a further search.
    """

    def __init__(self, problem: Problem, count: int, sigma: np.ndarray):
        robot = problem.robot
        self._problem, self._sigma, self._home = problem, sigma, points.rotations(problem.home[3:])
        redundancy = robot.m - problem.freedoms
        self._most, self._square = largest_cost(redundancy), redundancy == 0
        self._doubtful = largest_cost(redundancy, RARE)
        self.poses, self.errors = np.tile(problem.home, (count, 1)), np.full((count, robot.m), np.inf)
        self.ended, self.ambiguous, self.left = np.zeros(count, bool), np.zeros(count, bool), np.arange(count)
        self._score, self._plausible = np.full(count, np.inf), np.zeros(count, bool)

    def offer(self, rows: np.ndarray, poses: np.ndarray, errors: np.ndarray, ended: np.ndarray) -> None:
        """Keep the poses of `rows` that are better than the previous ones."""
        carriers = self._problem.of(rows).carriers
        cost = squares_of(self._problem.robot, poses, errors * self._sigma, self._sigma, carriers)
        fits = ended & (cost <= self._most)
        # The true pose may be one that hardly fits, or one that is not held with the file's CoM and load.
        plausible = ended & (cost <= self._doubtful)
        if self._square and fits.any():
            fits[fits] = taut(self._problem.robot, poses[fits], self._problem.of(rows[fits]).carriers)
        R = points.rotations(poses[:, 3:])
        turned = np.einsum("nij,ij->n", R, self._home)  # the trace of R R_home^T
        angle = np.arccos(np.clip(0.5 * (turned - 1.0), -1.0, 1.0))
        score = np.where(fits, cost + (angle / USUAL) ** 2, np.where(np.isfinite(cost), MISFIT + cost, np.inf))
        apart = np.abs(poses[:, :3] - self.poses[rows, :3]).max(axis=1) > APART * self._problem.robot.length
        apart |= np.abs(R - points.rotations(self.poses[rows, 3:])).max(axis=(1, 2)) > APART
        self.ambiguous[rows] |= plausible & self._plausible[rows] & apart
        better = score < self._score[rows]
        kept = rows[better]
        self.poses[kept], self.errors[kept] = poses[better], errors[better]
        self.ended[kept], self._score[kept] = ended[better], score[better]
        self._plausible[kept] = plausible[better]
        if not self._square:
            # Errors that are rounding leave no doubt: two poses of a redundant robot hardly share all their lengths.
            self.left = rows[~(fits & (cost <= EXACT**2))]


def level_platform(problem: Problem, lengths: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the poses, (N, 6), with approximately these lengths at the attitude of home."""
    straight = problem.free.copy()
    straight[3:] = 0.0
    home = np.broadcast_to(problem.home, (len(lengths), 6))
    return problem.descend(lengths, problem.milder(weights), home, DAMPING, straight)[0]


def _starts(problem: Problem, level: np.ndarray):
    """Yield initial poses, (N, 6) each, the most likely first."""
    yield level
    yield np.broadcast_to(problem.home, level.shape)
    for turn in TURNS:
        for axis in np.flatnonzero(problem.free[3:]):
            for sign in (1.0, -1.0):
                step = np.zeros(6)
                step[3 + axis] = sign * turn
                yield points.moved(level, step)
    if problem.robot.m == problem.freedoms == 6:
        for turn in OBLIQUE:
            for one, other in combinations(range(3, 6), 2):
                for signs in product((1.0, -1.0), repeat=2):
                    step = np.zeros(6)
                    step[[one, other]] = turn * np.sqrt(0.5) * np.array(signs)
                    yield points.moved(level, step)


def estimates(problem: Problem, lengths: np.ndarray, starts: np.ndarray | None, sigma: np.ndarray) -> PoseEstimate:
    """Return the poses that fit lengths (N, m) best, nearest to `starts` (N, 6) or, without any, of all."""
    robot, carriers, ambiguous = problem.robot, problem.carriers, None
    if starts is None:
        best, level = _Best(problem, len(lengths), sigma), level_platform(problem, lengths, 1.0 / sigma)
        for start in _starts(problem, level):
            left = best.left
            best.offer(left, *problem.of(left).descend_from_afar(lengths[left], 1.0 / sigma, start[left]))
            if not best.left.size:
                break
        poses, errors, ended, ambiguous = best.poses, best.errors, best.ended, best.ambiguous
    else:
        poses, errors, ended = problem.descend(lengths, 1.0 / sigma, starts, 0.0)
    errors *= sigma
    return PoseEstimate(robot, poses, errors, ended, sigma, carriers, ambiguous)
