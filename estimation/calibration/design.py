"""`next_poses`: the most informative poses to measure next (D-optimal design)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ...base.inputs import InputError, flag, real_array, shown, whole_number
from ...models.files import AnyRobot, as_robot
from ...models.robot import Robot
from ..logs.measurements import Measurements
from .calibration import Calibration
from .geometry import length_of
from .model import Model
from .parameters import Parameters, check_free
from .projection import equations_of, parts

DRAWN = 8192  # random poses, of which those at which the robot can rest are candidates
KEPT = 600
TILT = 0.3  # [rad], of random poses
MOST = 1000  # poses to choose
LARGEST = 100_000  # candidates


def next_poses(
    robot: AnyRobot | Calibration,
    candidates: ArrayLike | None = None,
    count: int = 10,
    free: str | Sequence[str] = ("anchors", "offsets"),
    measured: bool = True,
) -> np.ndarray:
    """Choose the poses to measure next, (count, 6) [m, rad]; a pose may be chosen twice.

    It greedily adds the pose that shrinks the parameters' error ellipsoid most.

    Args:
        robot: A robot, its name or its file if nothing was measured so far, or a `Calibration`, whose measurements are
            included.
        candidates: Poses to choose from, (k, 6) [m, rad]. Default: random ones with angles up to 0.3 rad at which
            tensions inside their limits hold the platform at rest.
        count: Number of poses.
        free: Parameters to estimate, as in `calibrate`; default: as in the `Calibration`. A clock offset is ignored.
        measured: True if poses will be measured, False if only lengths.

    Raises:
        InputError: If an argument is wrong, or no candidate exists.
    """
    if isinstance(robot, Calibration):
        calibration, chosen, groups = robot, robot.robot, robot.free
    else:
        calibration, chosen = None, as_robot(robot)
        groups = check_free(chosen, free)
    groups = tuple(group for group in groups if group != "clock")
    if not groups:
        raise InputError(f"free must have parameters other than clock, got {shown(free)}")
    flag("measured", measured)
    whole_number("count", count, 1, MOST)
    poses = _reachable(chosen) if candidates is None else _given(candidates)
    rows = _rows(chosen, groups, poses, measured)
    information = _so_far(calibration, chosen, groups)
    picked = []
    for _ in range(count):
        spread = np.linalg.inv(information)
        inside = np.eye(rows.shape[1]) + rows @ spread @ np.swapaxes(rows, 1, 2)
        best = int(np.argmax(np.linalg.slogdet(inside)[1]))
        picked.append(best)
        information = information + rows[best].T @ rows[best]
    return poses[picked]


def _rows(robot: Robot, groups: tuple[str, ...], poses: np.ndarray, measured: bool) -> np.ndarray:
    """Return the derivatives of lengths by parameters, minus the part that unknown poses absorb, (k, m, p) [1/m]."""
    lengths = np.ones((len(poses), robot.m))
    model = Model(
        Parameters(robot, groups), Measurements(lengths, poses), {}, np.ones((robot.m, len(poses)), dtype=bool)
    )
    state = model.begin()
    # For scales: the readings at these poses.
    readings = -model.residuals(state).readings.T * model.measurements.sigma.lengths
    table = model.parameters.table(state.x)
    readings = lengths - readings / table[:, 7]
    if not np.isfinite(readings).all():
        raise InputError("candidates must be poses at which every cable has a length, got one inside a pulley")
    model = replace(model, measurements=Measurements(readings, poses if measured else None), start=poses)
    rows = np.zeros((len(poses), robot.m, int(model.parameters.varies.sum())))
    for part in parts(model, state, equations_of(model, state)):
        for cable in range(robot.m):
            own, columns = part.without_poses(cable)
            rows[part.rows, cable][:, columns] = own
    return rows


def _so_far(calibration: Calibration | None, robot: Robot, groups: tuple[str, ...]) -> np.ndarray:
    """Return the information so far [1/m^2], (p, p), plus a small regularisation that makes it invertible."""
    size = int(Parameters(robot, groups).varies.sum())
    start = np.eye(size) / length_of(robot) ** 2
    if calibration is None:
        return start
    return start + calibration.information[:size, :size]


def _given(candidates: ArrayLike) -> np.ndarray:
    poses = np.array(real_array("candidates", candidates), dtype=float)
    if poses.ndim != 2 or poses.shape[1] != 6 or not 1 <= len(poses) <= LARGEST or not np.isfinite(poses).all():
        raise InputError(f"candidates must be 1 to {LARGEST} finite poses, (k, 6), got {shown(poses)}")
    return poses


def _reachable(robot: Robot) -> np.ndarray:
    """Return random poses at which the robot can rest, (k, 6) [m, rad]."""
    from ...models.dynamics import dynamics_of
    from ...solvers import solve_batch

    draw = np.random.default_rng(0)
    points = np.vstack([robot.home_anchors, robot.home[None, :3]])
    low, high = points.min(axis=0), points.max(axis=0)
    half = np.where(high - low > 0, (high - low) / 2, np.abs(robot.home[:3] - points.mean(axis=0)).max())
    poses = np.tile(robot.home, (DRAWN, 1))
    free = robot.dof_mask > 0
    random = np.hstack(
        [(low + high) / 2 + half * draw.uniform(-1, 1, (DRAWN, 3)), draw.uniform(-TILT, TILT, (DRAWN, 3))]
    )
    poses[:, free] = random[:, free]
    poses[0] = robot.home
    dynamics, rest = dynamics_of(robot), np.zeros(6)
    rows, scale = np.flatnonzero(free), robot.wrench_scale
    A = dynamics.wrench_matrix(poses)
    exists = np.isfinite(A).all(axis=(1, 2))
    poses, A = poses[exists], A[exists]
    w = dynamics.required_wrench(poses, rest, rest)
    scaled = A[:, rows] * scale[rows, None]
    holds = solve_batch(scaled, w[:, rows] * scale[rows], robot.t_min, robot.t_max).feasible
    if not holds.any():
        raise InputError(
            f"candidates must be given for robot {robot.name}, which can rest at none of {DRAWN} random poses, got none"
        )
    return poses[holds][:KEPT]
