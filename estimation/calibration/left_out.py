"""`left_out`: readings that are no lengths of taut cables, because a cable is slack or an encoder stands still."""

import numpy as np

from ...models.dynamics import dynamics_of
from ...models.robot import Robot
from ..logs.load_cells import SAME, slack
from ..logs.measurements import Measurements, carriers_of, tracked
from .balance import HARDLY, hangs
from .differences import PLAUSIBLE
from .geometry import length_of
from .parameters import Parameters

SLACK = "cables that hardly pull, which may be slack"
MOST_SLACK = 0.5  # of a cable's samples; more seem slack if the file or the poses are wrong
CHUNK = 10_000  # samples


def left_out(robot: Robot, measurements: Measurements, carried: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Return which readings no fit uses, (N, m) of bool, by the reason.

    `carried` are tensions (N, m) [N] of a platform that `hangs`, from a fit; default: those by the file, at rest.
    """
    loose = hardly_pull(_at_rest(robot, measurements) if carried is None else carried)
    return {
        SLACK: slack(robot, measurements) | loose,
        "encoders that stand still while their cables move": _still(robot, measurements),
    }


def hardly_pull(tensions: np.ndarray) -> np.ndarray:
    """Return which tensions (N, m) [N] are so small, or negative, that the cable may be slack, (N, m) of bool.

    None of a cable are if too many would be, nor are those that are nan.
    """
    known = tensions[np.isfinite(tensions)]
    result = tensions < HARDLY * (np.abs(known).mean() if known.size else 0.0)
    return np.asarray(result & (result.mean(axis=0) < MOST_SLACK))


def _still(robot: Robot, measurements: Measurements) -> np.ndarray:
    """Return which readings stay the same although poses show that the cable's length changes, (N, m) of bool.

    It must change by more than displaced ends of cables explain; without poses, all other readings must. Winches that
    are all locked for most of the log hold still themselves.
    """
    y, known = measurements.lengths, tracked(robot, measurements)
    rows, result = np.flatnonzero(known if known.any() else ~known), np.zeros(y.shape, dtype=bool)
    same = np.abs(np.diff(y[rows], axis=0)) <= SAME * np.abs(y).max(axis=0)
    if not same.any() or same.all(axis=1).mean() > MOST_SLACK:
        return result
    parameters = Parameters(robot, ())
    lengths = parameters.table(parameters.first)[:, 7] * y[rows]
    if known.any():
        lengths = np.asarray(dynamics_of(robot).cable_lengths(*_poses(robot, measurements, rows)))
    for i in np.flatnonzero(same.any(axis=0)):
        begins = np.flatnonzero(np.concatenate([[True], ~same[:, i]]))  # of parts with the same reading
        of = lengths[:, [i]] if known.any() else np.delete(lengths, i, axis=1)
        change = np.maximum.reduceat(of, begins) - np.minimum.reduceat(of, begins)
        moved = change.min(axis=1) > PLAUSIBLE * length_of(robot)
        result[rows, i] = np.repeat(moved, np.diff(begins, append=len(rows)))
    return result


def _at_rest(robot: Robot, measurements: Measurements) -> np.ndarray:
    """Return the tensions at measured poses of a platform at rest that `hangs`, (N, m) [N], nan where unknown."""
    result, known = np.full(measurements.lengths.shape, np.nan), tracked(robot, measurements)
    axes = np.flatnonzero(robot.dof_mask)
    if not hangs(robot, measurements) or measurements.poses is None or not known.any():
        return result
    if np.isnan(measurements.poses[known][:, axes]).any():
        return result
    for rows in np.array_split(np.flatnonzero(known), len(known) // CHUNK + 1):
        poses, carriers = _poses(robot, measurements, rows)
        A = np.asarray(dynamics_of(robot).wrench_matrix(poses, carriers))[:, axes] * robot.wrench_scale[axes, None]
        wrench = np.asarray(dynamics_of(robot).required_wrench(poses, 0 * poses, 0 * poses))[:, axes]
        result[rows] = (np.linalg.pinv(A) @ (wrench * robot.wrench_scale[axes])[..., None])[..., 0]
    return result


def _poses(robot: Robot, measurements: Measurements, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return poses of the platform, (k, 6), and of the carriers, (k, c, 6) or (c, 6) at home, at some samples."""
    part = measurements.only(rows)
    assert part.poses is not None  # where positions are tracked
    poses = np.where(np.isfinite(part.poses), part.poses, robot.home)
    return poses, carriers_of(robot, part)
