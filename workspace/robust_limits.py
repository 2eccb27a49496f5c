"""Robust feasibility: tension limits tightened by the tension spread, configuration by configuration.

The spread depends on the tensions, so the limits are tightened iteratively: first for the tensions of the nominal
robot, then for the tensions inside the tightened limits, and so on. A configuration is accepted if the tensions of one
iteration keep their own spread from the limits. For a robot with more cables than needed the iteration may miss a
solution, so the result may be too small, but never too large.
"""

import numpy as np

from ..base.errors import InputError
from ..models import Robot
from ..solvers import solve_batch
from ..statics.robust import Spread, check_share, ellipsoid_factor, uncertainty_of
from .places import Places

ROUNDS = 4
GROWTH = 1.02  # of the differences: those of the next tensions may be larger
PLACES_AT_ONCE = 1024  # a place takes some 3000 numbers for a robot of which 48 are uncertain
ROUNDING = 1e-12  # of the largest limit


class Tightened:
    """Decide where a share of the robots has tensions inside their limits, all these robots at all places.

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
        for start in range(0, len(places), PLACES_AT_ONCE):
            part = np.arange(start, min(start + PLACES_AT_ONCE, len(places)))
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
