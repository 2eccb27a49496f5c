"""Decide at which configurations tensions inside their limits give the required wrenches, for many at once.

The wrench rows are those of the coordinates that can move, with moments divided by `Robot.length`, so that all are in
newtons. A few thousand configurations are processed at a time, so that their matrices stay in the cache.
"""

from collections.abc import Iterator

import numpy as np

from ..base.inputs import InputError, required
from ..models import Robot
from ..models.dynamics import dynamics_of
from ..solvers import solve_batch
from ..statics.robust import Spread, check_share, ellipsoid_factor, uncertainty_of
from .places import Places, check_places

PLACES_AT_ONCE = 8192
ONLY_EXACT = 0.01  # of the force scale
NEAREST = 1e10  # weight of the wrench error, so large that the tensions do not change the nearest wrench
ROUNDS = 4
GROWTH = 1.02  # factor for the differences, which may be larger for the next tensions
UNCERTAIN_AT_ONCE = 1024  # a place takes some 3000 numbers for a robot of which 48 are uncertain
ROUNDING = 1e-12  # of the largest limit


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


class Tightened:
    """Decide where a share of the robots has tensions inside their limits, all these robots at all places.

    The limits are tightened by the tension spread, which depends on the tensions, so iteratively: first for those of
    the nominal robot, then for those inside the tightened limits, and so on. A configuration is accepted if the
    tensions of one iteration keep their own spread from the limits. For a robot with more cables than needed the
    iteration may miss a solution, so the result may be too small, but never too large.

    - `robot`: with an uncertainty.
    - `share`: of the robots, above 0 and below 1.
    - `rows`: wrench rows that the cables give.

    Raises `InputError` if the robot has no uncertainty, or fewer cables than rows, or the share is none.
    """

    def __init__(self, robot: Robot, share: float, rows: np.ndarray):
        check_share(robot, share)
        if robot.m < rows.size:
            raise InputError(f"robust must be left out for {robot.m} cables and {rows.size} wrench rows, got {share:g}")
        self._robot, self._rows = robot, rows
        self._factor = ellipsoid_factor(uncertainty_of(robot), share)

    def feasible(self, places: Places, A: np.ndarray, wrenches: np.ndarray) -> np.ndarray:
        """Return where the robots have tensions for every one of some wrenches, (n,) of bool.

        - `places`: the n places.
        - `A`: their scaled wrench matrices, (n, rows, m) [N per N].
        - `wrenches`: (k, rows) for all places or (k, n, rows), scaled [N].
        """
        held = np.zeros(len(places), dtype=bool)
        wrenches = np.broadcast_to(wrenches if wrenches.ndim == 3 else wrenches[:, None], (len(wrenches), *A.shape[:2]))
        for start in range(0, len(places), UNCERTAIN_AT_ONCE):
            part = np.arange(start, min(start + UNCERTAIN_AT_ONCE, len(places)))
            for w in wrenches:
                exact = solve_batch(A[part], w[part], self._robot.t_min, self._robot.t_max, threads=1)
                part = part[exact.feasible]
            if not part.size:
                continue
            some = places.only(part)
            spread = Spread(self._robot, some.pose, some.carriers, self._rows)
            left = np.arange(part.size)
            for w in wrenches:
                left = left[self._holds(spread.only(left), A[part[left]], w[part[left]])]
            held[part[left]] = True
        return held

    def _holds(self, spread: Spread, A: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Return where tensions are found that stay inside the limits with what they differ by, (n,) of bool."""
        low, high = self._robot.t_min, self._robot.t_max
        rounding = ROUNDING * float(high.max())
        held = np.zeros(len(A), dtype=bool)
        tensions = solve_batch(A, w, low, high, threads=1).tensions
        left = np.arange(len(A))
        for _ in range(ROUNDS):
            reach = self._factor * spread.only(left).sigmas(tensions)
            outside = np.maximum(low + reach - tensions, tensions + reach - high).max(axis=1)
            inside = outside <= rounding
            held[left[inside]] = True
            reach, tensions, left = GROWTH * reach[~inside], tensions[~inside], left[~inside]
            wide = (low + reach <= high - reach).all(axis=1)
            reach, tensions, left = reach[wide], tensions[wide], left[wide]
            if not left.size:
                break
            solved = solve_batch(A[left], w[left], low + reach, high - reach, tensions, threads=1)
            tensions, left = solved.tensions[solved.feasible], left[solved.feasible]
        return held
