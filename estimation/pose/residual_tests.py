"""`residual_tests`, `squares_of`: statistical tests of residuals with the noise of lengths and the file's uncertainty.

With the covariance C of all errors of the lengths, and their derivatives J by the pose, residuals r are tested by

    r' W r,    W = C^-1 - C^-1 J (J' C^-1 J)^-1 J' C^-1,

the least squared error over all poses. It has a chi-square distribution with as many degrees of freedom as there are
redundant cables, even for the pose with the least error by the noise alone, since W J = 0.
"""

import numpy as np

from ...core import lines
from ...models.dynamics import dynamics_of
from ...models.parameters import locate
from ...models.record import record_of
from ...models.robot import Robot
from ..logs.encoders import readings_of

BLOCK = 5000  # poses, so that few derivatives are in memory at once
SINGULAR = 1e-9  # share of the largest singular value
EXPLICABLE = 1e16  # squared error in standard deviations; no uncertainty of a file explains more
COLUMNS = {"anchor": 0, "attachment": 3, "radius": 6, "encoder": 7}  # of the derivatives of a length


def squares_of(
    robot: Robot, pose: np.ndarray, residuals: np.ndarray, sigma: np.ndarray, carriers: np.ndarray
) -> np.ndarray:
    """Return the squared residuals of each pose in standard deviations, (N,), with arguments as `residual_tests`."""
    with np.errstate(over="ignore"):  # of a descent that ran away
        squares = np.sum(np.square(residuals / sigma), axis=1)
    rows = squares < EXPLICABLE
    if robot.uncertainty is not None and rows.any():
        at = carriers if carriers.ndim == 2 else carriers[rows]
        squares[rows] = residual_tests(robot, pose[rows], residuals[rows], sigma, at)[0]
    return squares


def residual_tests(
    robot: Robot, pose: np.ndarray, residuals: np.ndarray, sigma: np.ndarray, carriers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the squared residuals r' W r of each pose, (N,), and the test statistic of each cable, (N, m).

    A statistic W r / sqrt(diag W) is normally distributed with variance 1 unless the length is wrong (Baarda). It is 0
    for a cable without redundancy.

    - `pose`: poses with the least squared errors by `sigma`, (N, 6) [m, rad].
    - `residuals`: lengths at these poses minus measured ones [m], (N, m).
    - `sigma`: standard deviations of measured lengths [m], (m,).
    - `carriers`: poses of the carriers, (c, 6) or (N, c, 6).
    """
    squares, statistics, free = np.empty(len(pose)), np.empty(residuals.shape), robot.dof_mask > 0
    for first in range(0, len(pose), BLOCK):
        rows = slice(first, first + BLOCK)
        at = carriers if carriers.ndim == 2 else carriers[rows]
        lengths = dynamics_of(robot).cable_lengths(pose[rows], at) - residuals[rows]
        L, J = (of / sigma[:, None] for of in length_errors(robot, pose[rows], lengths, at))
        C = np.broadcast_to(np.eye(robot.m), (len(lengths), robot.m, robot.m))
        if robot.uncertainty is not None:
            C = C + L @ robot.uncertainty.matrix @ np.swapaxes(L, 1, 2)
        root = np.linalg.inv(np.linalg.cholesky(C))  # of C^-1
        U, values, _ = np.linalg.svd(root @ (J * robot.wrench_scale)[..., free], full_matrices=False)
        U = U * (values > SINGULAR * values[:, :1])[:, None, :]
        checked = root - U @ (np.swapaxes(U, 1, 2) @ root)  # W = checked' checked
        e = checked @ (residuals[rows] / sigma)[..., None]
        squares[rows] = np.sum(e[..., 0] ** 2, axis=1)
        own, whole = (np.sum(of**2, axis=1) for of in (checked, root))
        size = np.abs(np.swapaxes(checked, 1, 2) @ e)[..., 0] / np.sqrt(np.maximum(own, 1e-300))
        statistics[rows] = np.where(own > 1e-6 * whole, size, 0.0)
    return squares, statistics


def length_errors(
    robot: Robot, pose: np.ndarray, lengths: np.ndarray, carriers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives (N, m, p) of lengths at a pose minus measured ones by the file's p uncertain parameters.

    Encoders convert readings to measured lengths, and errors of their parameters are correlated with those of anchors
    because a calibration determines their sum. Also return d lengths / d (x, y, z, small rotation in {G}), (N, m, 6).

    - `robot`: a robot; p = 0 if its file has no uncertainty.
    - `pose`: poses of the platform in {G}, (N, 6) [m, rad].
    - `lengths`: measured lengths [m], (N, m); the strain of cables is neglected.
    - `carriers`: poses of the carriers, (c, 6) or (N, c, 6).
    """
    names = robot.uncertainty.parameters if robot.uncertainty else ()
    count, m = lengths.shape
    record, A, derivatives = record_of(robot).copy(), np.empty((count, 6, m)), np.empty((count, m, 7))
    record["com"] = 0.0  # moments are those about the platform's origin
    lines(record, np.ascontiguousarray(pose), carriers, np.empty((count, m)), A, None, None, derivatives)
    readings = readings_of(robot, lengths)
    by_encoder = -np.stack([np.ones_like(readings), readings, readings**2], axis=2)
    derivatives = np.concatenate([derivatives, by_encoder], axis=2)  # (N, m, 10)
    L = np.zeros((count, m, len(names)))
    for column, name in enumerate(names):
        cable, part, axis = locate(name)
        L[:, cable, column] = derivatives[:, cable, COLUMNS[part] + axis]
    return L, -np.swapaxes(A, 1, 2)
