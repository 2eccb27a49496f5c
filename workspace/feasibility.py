"""Decide at which configurations tensions inside their limits give the required wrenches, for many at once.

The wrench rows are those of the coordinates that can move, with moments divided by `Robot.length`, so that all are in
newtons. A few thousand configurations are processed at a time, so that their matrices stay in the cache.
"""

from collections.abc import Iterator

import numpy as np

from ..base.inputs import required
from ..models import Robot
from ..models.dynamics import dynamics_of
from ..solvers import solve_batch
from .places import Places, check_places
from .robust_limits import Tightened

PLACES_AT_ONCE = 8192
ONLY_EXACT = 0.01  # of the force scale
NEAREST = 1e10  # weight of the wrench error, so large that the tensions do not change the nearest wrench


def rest_wrench(robot: Robot) -> np.ndarray:
    """Return the wrench that balances the weight of the platform, about the CoM, (6,) [N, N m]."""
    return dynamics_of(robot).required_wrench(robot.home, np.zeros(6), np.zeros(6))


def wrench_rows(robot: Robot, forces_only: bool = False) -> np.ndarray:
    """Return the indices of the wrench rows of the coordinates that can move, or of those that are forces."""
    rows = np.flatnonzero(required("robot", robot, Robot).dof_mask)
    return rows[rows < 3] if forces_only else rows


def scaled(robot: Robot, wrenches: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return some rows of wrenches (..., 6) [N, N m] with moments divided by the robot's length, (..., rows) [N]."""
    return wrenches[..., rows] * robot.wrench_scale[rows]


def wrench_matrices(robot: Robot, places: Places, rows: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """Yield slices of a few thousand configurations, and their wrench matrices (k, rows, m) [N per N]."""
    dynamics = dynamics_of(robot)
    scale = robot.wrench_scale[rows]
    for start in range(0, len(places), PLACES_AT_ONCE):
        part = slice(start, start + PLACES_AT_ONCE)
        A = dynamics.wrench_matrix(places.pose[part], places.carriers[part])
        if rows.size < 6:
            A = A[:, rows]
        if (scale != 1.0).any():
            A *= scale[:, None]
        yield part, A


def feasible(
    robot: Robot, places: Places, wrenches: np.ndarray, rows: np.ndarray | None = None, robust: float | None = None
) -> np.ndarray:
    """Return whether tensions inside their limits give all of some wrenches, (n,) of bool.

    Args:
        wrenches: (k, 6) for all configurations or (k, n, 6), about the CoM in {G} [N, N m].
        rows: Wrench rows to balance; default: those of the coordinates that can move.
        robust: Fraction of the uncertain robots for which tensions must exist; default: the nominal robot only.
    """
    rows = wrench_rows(robot) if rows is None else rows
    tightened = None if robust is None else Tightened(robot, robust, rows)
    to_give = scaled(robot, wrenches, rows)
    shared = to_give.ndim == 2
    held = np.zeros(len(places), dtype=bool)
    for part, A in wrench_matrices(robot, places, rows):
        left = np.arange(len(A))
        if tightened is not None:
            held[part] = tightened.feasible(places.only(part), A, to_give if shared else to_give[:, part])
            continue
        for w in to_give if shared else to_give[:, part]:
            some = A if left.size == len(A) else A[left]
            left = left[solve_batch(some, w if shared else w[left], robot.t_min, robot.t_max, threads=1).feasible]
            if not left.size:
                break
        held[part.start + left] = True
    return held


def shortfall(
    robot: Robot, places: Places, wrenches: np.ndarray, rows: np.ndarray | None = None, robust: float | None = None
) -> np.ndarray:
    """Return the largest distance of wrenches (k, 6) from the available wrench set, as a lower bound, (n,) [N].

    It is the shortfall of the batch solver's certificates: zero exactly where `feasible` is true. If the nominal robot
    has tensions but the fraction `robust` of the uncertain robots does not, it is 1 % of the force scale.
    """
    check_places(robot, places)
    rows = wrench_rows(robot) if rows is None else rows
    largest = np.zeros(len(places))
    for part, A in wrench_matrices(robot, places, rows):
        for w in scaled(robot, wrenches, rows):
            solved = solve_batch(A, w, robot.t_min, robot.t_max, threads=1)
            short = np.where(solved.feasible, 0.0, np.nan_to_num(solved.shortfall, nan=np.inf))
            largest[part] = np.maximum(largest[part], short)
    if robust is not None:
        exact = np.flatnonzero(largest == 0)
        held = feasible(robot, places.only(exact), wrenches, rows, robust)
        largest[exact[~held]] = ONLY_EXACT * robot.force_scale
    return largest


def too_few_cables(robot: Robot) -> str | None:
    """Return a sentence if the robot has fewer cables than degrees of freedom, else None."""
    count = wrench_rows(robot).size
    if robot.m >= count:
        return None
    return (
        f"{robot.m} cables cannot balance {count} components of force and moment, except at single poses; "
        "request equilibrium-posture, which lets the platform turn until they balance, or force-balance, which "
        "checks the forces alone"
    )
