"""`pose_from_lengths`: the pose of the platform from the lengths of its cables."""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...base.inputs import leading, repeated, shown
from ...core import extent, one_pose_from_lengths
from ...models.batch import as_array
from ...models.files import AnyRobot, as_robot
from ...models.part import LARGEST
from ...models.robot import Robot
from .estimate import PoseEstimate
from .problem import Problem, problem_of
from .resting import resting
from .search import estimates

SIGMA = 1e-3  # [m], of a measured length: what a winch with an encoder achieves
MOST = 1e100  # [m]: larger ones, and inverses of smaller ones, cannot be squared beside lengths


def pose_from_lengths(
    robot: AnyRobot,
    lengths: ArrayLike,
    start: ArrayLike | None = None,
    carrier_pose: ArrayLike | None = None,
    sigma: ArrayLike = SIGMA,
) -> PoseEstimate:
    """Estimate the pose of the platform from the lengths of its cables: forward kinematics.

    The Levenberg-Marquardt method minimises the squared errors of the lengths, with rotations as increments on SO(3).
    If the lengths do not determine the pose, as with parallel cables or few of them, the result is the equilibrium
    pose, see `statics.equilibria`.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        lengths: Measured lengths of taut cables, from anchor to attachment, over the pulley if there is one, (..., m)
            [m].
        start: Initial pose, (..., 6) [m, rad], such as the last one of a stream: the estimate is the minimum near it.
            Default: a search without a start. If several poses fit, `branches` lists them.
        carrier_pose: Poses of the carriers in {G}, (..., c, 6); default: at home.
        sigma: Standard deviations of the lengths [m], one number or (m,).

    Raises:
        InputError: If an argument has a wrong shape or value, or the robot has more than 32 cables or 8 carriers.
    """
    robot = as_robot(robot)
    lengths, deviations = checked_lengths(lengths, robot), checked_sigma(sigma, robot.m)
    shapes = {"lengths": lengths.shape[:-1]}
    carriers = None
    if carrier_pose is not None:
        carriers = _poses("carrier_pose", carrier_pose, (len(robot.carriers), 6))
        shapes["carrier_pose"] = carriers.shape[:-2]
    if start is not None:
        start = _poses("start", start, (6,))
        shapes["start"] = start.shape[:-1]
    if not any(shapes.values()) and start is not None and not (problem := problem_of(robot, carriers)).open:
        return _near(problem, lengths, start, carriers, deviations)
    batch = lengths.shape[:-1] if len(set(shapes.values())) == 1 else leading(shapes)
    rows = _rows(lengths, batch, 1)
    each = carriers if carriers is None or carriers.ndim == 2 else _rows(carriers, batch, 2)
    problem = problem_of(robot, each)
    starts = None if start is None else _start(problem, start, batch)
    found = estimates(problem, rows, starts, deviations)
    if problem.open:
        found = resting(found, problem, rows, starts)
    found.reshape(batch, carriers)
    return found


def _near(
    problem: Problem, lengths: np.ndarray, start: np.ndarray, carriers: np.ndarray | None, sigma: np.ndarray
) -> PoseEstimate:
    """Return the pose, with its covariance, that fits the lengths (m,) of one pose near a start (6,) best."""
    pose = np.where(problem.free > 0.0, start, problem.home) if problem.freedoms < 6 else start.copy()
    residuals, covariance = np.empty(problem.robot.m), np.empty((6, 6))
    lengths = np.ascontiguousarray(lengths)
    found = one_pose_from_lengths(problem.record, problem.carriers, lengths, sigma, pose, residuals, covariance)
    return PoseEstimate(problem.robot, pose, residuals, found, sigma, carriers, known_covariance=covariance)


def checked_lengths(lengths: ArrayLike, robot: Robot) -> np.ndarray:
    """Return lengths (..., m), or raise InputError unless all are above zero and of a size that can be squared."""
    return _of_a_size("lengths", "m", lengths, (robot.m,), positive=True)


def one_pose(lengths: ArrayLike, carrier_pose: ArrayLike | None, robot: Robot) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the lengths (m,) and carriers (c, 6), or None, of one pose, or raise InputError."""
    measured, carriers = checked_lengths(lengths, robot), None
    if measured.ndim != 1:
        raise InputError(f"lengths must have the shape ({robot.m},), those of one pose, got {shown(measured)}")
    if carrier_pose is not None:
        carriers = _poses("carrier_pose", carrier_pose, (len(robot.carriers), 6))
        if carriers.ndim != 2:
            raise InputError(f"carrier_pose must have the shape {robot.carrier_home.shape}, got {carriers.shape}")
    return measured, carriers


def checked_sigma(sigma: ArrayLike, m: int) -> np.ndarray:
    """Return standard deviations (m,) of one number or (m,), or raise InputError unless they can be squared."""
    if isinstance(sigma, float) and 1.0 / MOST < sigma < MOST:
        return _equal(sigma, m)
    deviations = repeated("sigma", sigma, m)
    wrong = ~((deviations > 1.0 / MOST) & (deviations < MOST))
    if wrong.any():
        raise InputError(f"sigma must be numbers > 0 [m], {1 / MOST:g} to {MOST:g}, got {deviations[wrong][0]:g}")
    return deviations


@lru_cache(maxsize=16)
def _equal(sigma: float, m: int) -> np.ndarray:
    """Return the same standard deviation for all cables, cached for the next call of a stream."""
    deviations = np.full(m, sigma)
    deviations.flags.writeable = False
    return deviations


def _poses(name: str, value: ArrayLike, core: tuple[int, ...]) -> np.ndarray:
    """Return poses, or raise InputError unless they are of a size that can be squared."""
    return _of_a_size(name, "m, rad", value, core)


def _of_a_size(name: str, unit: str, value: ArrayLike, core: tuple[int, ...], positive: bool = False) -> np.ndarray:
    """Return an array (..., *core), or raise InputError if the square of a number would be too large."""
    array = as_array(name, value, core)
    least, most = extent(array if array.flags.c_contiguous else np.ascontiguousarray(array))
    if positive and not least > 0.0:
        raise InputError(f"{name} must be numbers > 0 [{unit}], got {least:g}")
    if (largest := max(-least, most)) > LARGEST:
        raise InputError(f"{name} must be numbers up to {LARGEST:g} [{unit}], got {largest:g}")
    return array


def _rows(array: np.ndarray, batch: tuple[int, ...], core: int) -> np.ndarray:
    """Return (N, ...) of an array whose last `core` dimensions are its own."""
    if not batch:
        return np.ascontiguousarray(array[None])
    own = array.shape[array.ndim - core :]
    if array.shape == batch + own:
        return np.ascontiguousarray(array.reshape(-1, *own))
    return np.ascontiguousarray(np.broadcast_to(array, batch + own).reshape(-1, *own))


def _start(problem: Problem, start: np.ndarray, batch: tuple[int, ...]) -> np.ndarray:
    """Return starts (N, 6), with coordinates that cannot move at home."""
    rows = _rows(start, batch, 1)
    return rows if problem.freedoms == 6 else np.where(problem.free > 0.0, rows, problem.home)
