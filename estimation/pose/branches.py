"""`branches`: all poses of the platform with the given cable lengths.

With six cables and six coordinates there are up to 40 such poses, for nist-robocrane most often eight. With more
cables one remains, and others whose lengths differ by less than the noise. No method lists them all in milliseconds.
Descents from attitudes spread evenly over SO(3) find most of them.
"""

import numpy as np
from numpy.typing import ArrayLike

from ...base.inputs import whole_number
from ...models import points
from ...models.files import AnyRobot, as_robot
from ...models.robot import Robot
from ...statics.equilibria import equilibria
from .estimate import PoseEstimate, largest_cost, taut
from .from_lengths import SIGMA, checked_sigma, one_pose
from .residual_tests import squares_of
from .search import APART, Problem, level_platform, problem_of


def branches(
    robot: AnyRobot,
    lengths: ArrayLike,
    carrier_pose: ArrayLike | None = None,
    sigma: ArrayLike = SIGMA,
    starts: int = 512,
    seed: int = 0,
) -> list[PoseEstimate]:
    """List the poses with cable lengths that fit measured ones.

    Poses in which the cables can hold the weight at rest come first, since measured cables are taut. Within both groups
    the poses are sorted by their rotation from home.

    Args:
        lengths, carrier_pose, sigma: As in `pose_from_lengths`, for one pose.
        starts: Number of initial poses. Some poses may be missed; more starts miss fewer. If gravity determines the
            pose, the results are equilibria, which have separate starts.
        seed: Seed of the starts.

    Raises:
        InputError: If an argument has a wrong shape or value.
    """
    robot = as_robot(robot)
    starts = whole_number("starts", starts, 1, 1_000_000)
    seed = whole_number("seed", seed, 0, 2**63 - 1)
    measured, carriers = one_pose(lengths, carrier_pose, robot)
    deviations = checked_sigma(sigma, robot.m)
    problem = problem_of(robot, carriers)
    if problem.open:
        from .from_lengths import pose_from_lengths

        rests = equilibria(robot, measured, carriers)
        return [pose_from_lengths(robot, measured, rest.pose, carriers, deviations) for rest in rests]
    rows, weights = np.tile(measured, (starts, 1)), 1.0 / deviations
    spread = _spread(robot, problem, level_platform(problem, rows[:1], weights)[0], starts, seed)
    poses, errors, ended = problem.descend_from_afar(rows, weights, spread)
    cost = squares_of(robot, poses, errors * deviations, deviations, problem.carriers)
    fits = np.flatnonzero(ended & (cost <= largest_cost(robot.m - problem.freedoms)))
    apart: list[int] = []
    for row in fits[np.argsort(cost[fits], kind="stable")].tolist():
        if not _is_among(poses[row], poses[apart], robot.length):
            apart.append(row)
    if not apart:
        return []
    held, turned = taut(robot, poses[apart], carriers), np.linalg.norm(poses[apart, 3:] - problem.home[3:], axis=1)
    order = np.array(apart)[np.lexsort((turned, ~held))]
    given = (True, deviations, carriers, len(apart) > 1)
    return [PoseEstimate(robot, poses[row], errors[row] * deviations, *given) for row in order.tolist()]


def _spread(robot: Robot, problem: Problem, level: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Return starts (N, 6): the level platform and home, then any attitude, about the level platform."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(seed)
    reach = 2.0 * robot.length + 0.5 * np.ptp(points.anchors(robot, problem.carriers), axis=0).max()
    poses = np.tile(level, (count, 1))
    poses[:, :3] += rng.uniform(-1.0, 1.0, (count, 3)) * reach
    turning = problem.free[3:] > 0.0
    if turning.all():
        poses[:, 3:] = points.angles(Rotation.from_quat(rng.normal(size=(count, 4))).as_matrix())
    else:
        poses[:, 3:][:, turning] = rng.uniform(-np.pi, np.pi, (count, int(turning.sum())))
    poses[0], poses[1:2] = level, problem.home
    return np.where(problem.free > 0.0, poses, problem.home)


def _is_among(pose: np.ndarray, others: np.ndarray, length: float) -> bool:
    """Return whether a pose (6,) is one of (N, 6), up to `APART`."""
    near = np.abs(others[:, :3] - pose[:3]).max(axis=1, initial=0.0) <= APART * length
    turned = points.rotations(others[:, 3:]) - points.rotations(pose[3:])
    return bool((near & (np.abs(turned).max(axis=(1, 2), initial=0.0) <= APART)).any())
