"""`pose_from_lengths`: the pose of the platform from the lengths of its cables, or from them and its weight."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from ...base.inputs import InputError, leading, repeated, shown
from ...base.text import counted
from ...core import extent, one_pose_from_lengths
from ...models import points
from ...models.batch import as_array
from ...models.files import AnyRobot, as_robot
from ...models.part import LARGEST
from ...models.robot import Robot
from ...statics.equilibria import Equilibrium, equilibria, rests_near, sensitivity
from .estimate import PoseEstimate, unbounded
from .residual_tests import length_errors
from .search import Problem, estimates, problem_of

SIGMA = 1e-3  # [m], of a measured length: what a winch with an encoder achieves
MOST = 1e100  # [m]: larger ones, and inverses of smaller ones, cannot be squared beside lengths
BLOCK = 1000  # equilibria that are computed together
STEP = 1e-5  # of a numerical derivative, in radians, and times the platform's size


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
    carriers = None if carrier_pose is None else _poses("carrier_pose", carrier_pose, (len(robot.carriers), 6))
    if start is not None:
        start = _poses("start", start, (6,))
        if lengths.ndim == start.ndim == 1 and (carriers is None or carriers.ndim == 2):
            problem = problem_of(robot, carriers)
            if not problem.open:
                return _near(problem, lengths, start, carriers, deviations)
    arguments = {"lengths": (lengths, 1), "carrier_pose": (carriers, 2), "start": (start, 1)}
    shapes = {name: of.shape[: of.ndim - core] for name, (of, core) in arguments.items() if of is not None}
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
        raise InputError(f"lengths must have the shape ({robot.m},), for one pose, got {shown(measured)}")
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


def resting(own: PoseEstimate, problem: Problem, lengths: np.ndarray, starts: np.ndarray | None) -> PoseEstimate:
    """Return estimates from lengths (N, m): the equilibrium if these do not determine the pose well.

    An equilibrium is near `starts` (N, 6) or, without any, near the pose from lengths alone. With fewer cables than
    coordinates it is anywhere. Raises `InputError` if the robot has no gravity and too few cables, so that the pose
    is undetermined.
    """
    robot, few = problem.robot, problem.robot.m < problem.freedoms
    if few and robot.weight == 0.0:
        raise InputError(
            "gravity must not be zero if the lengths do not determine the pose, got none for robot "
            f"{robot.name!r}, which has {counted(robot.m, 'cable')} for {problem.freedoms} coordinates"
        )
    if few:
        own.converged, own.ambiguous = np.zeros(len(lengths), bool), None
    hang = np.flatnonzero(~(own.consistent & own.conditioned))
    if robot.weight == 0.0 or not hang.size:
        return own
    covariance, by_gravity = own.covariance_of_noise.copy(), np.full(len(lengths), few)
    by_parameters = np.zeros_like(covariance) if robot.uncertainty else None
    near = own.pose if starts is None else starts
    carriers = np.broadcast_to(problem.carriers, (len(lengths), *robot.carrier_home.shape))
    for first in range(0, hang.size, BLOCK):
        rows = hang[first : first + BLOCK]
        rests, found = rests_near(robot, lengths[rows], near[rows], carriers[rows])
        if few and starts is None:
            for k in np.flatnonzero(~found):
                for rest in equilibria(robot, lengths[rows[k]], carriers[rows[k]])[:1]:
                    rests.put(k, rest)
                    found[k] = True
        rows, rests = rows[found], rests.only(found)
        own.pose[rows], own.converged[rows], by_gravity[rows] = rests.pose, True, True
        own.residuals[rows] = np.where(rests.taut, rests.lengths - lengths[rows], 0.0)
        by_length, by_file, neutral = _motions(robot, rests, lengths[rows], carriers[rows])
        covariance[rows] = unbounded((by_length * own.sigma**2) @ by_length.swapaxes(1, 2), neutral)
        if by_parameters is not None and robot.uncertainty is not None:
            by_parameters[rows] = by_file @ robot.uncertainty.matrix @ by_file.swapaxes(1, 2)
    return replace(own, by_gravity=by_gravity, known_covariance=covariance, by_parameters=by_parameters)


def _motions(robot: Robot, rests: Equilibrium, lengths: np.ndarray, carriers: np.ndarray) -> list[np.ndarray]:
    """Return motions of the platform frame, as its shift and a small rotation in {G}, at N equilibria.

    They are the derivatives by measured lengths, (N, 6, m), and by the file's uncertain parameters, (N, 6, p), and
    neutral motions, (N, 6, k). With the energy E = -m g c + sum t_i (l_i - L_i), a parameter acts like a change of
    lengths and the wrench -d^2 E / (dpose dparameter).
    """
    by_length, compliance, neutral = sensitivity(robot, rests, carriers)
    step = STEP * np.diag([robot.length] * 3 + [1.0] * 3)
    around = points.moved(rests.pose[:, None], np.vstack([np.zeros(6), step, -step]))  # (N, 13, 6)
    flat = around.reshape(-1, 6), np.repeat(lengths, 13, axis=0), np.repeat(carriers, 13, axis=0)
    L, _ = length_errors(robot, *flat)
    L = L.reshape(len(lengths), 13, *L.shape[1:])
    pulled = np.einsum("ni,nkip->nkp", rests.tensions, L)
    wrench = (pulled[:, 7:] - pulled[:, 1:7]) / (2 * np.diag(step)[:, None])
    arm = (points.rotations(rests.pose[:, 3:]) @ np.array(robot.platform.com))[..., None]  # (N, 3, 1)
    wrench[:, 3:] -= np.cross(arm, wrench[:, :3], axis=1)  # about the CoM
    motions = [by_length, compliance @ wrench - by_length @ L[:, 0], neutral]
    for of in motions:
        of[:, :3] += np.cross(arm, of[:, 3:], axis=1)  # of the CoM before
    return motions
