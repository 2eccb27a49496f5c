"""`within_motors`: other tensions of a motion where those of least norm are too much for the motors of winches."""

import numpy as np

from ...solvers import solve_batch
from ..limits.cables import WinchForce, WinchPower
from ..tasks.scenario import Scenario


def within_motors(
    scenario: Scenario, times: np.ndarray, A: np.ndarray, case: tuple[np.ndarray, np.ndarray], values: list[np.ndarray]
) -> np.ndarray:
    """Return the tensions (n, m) [N] of a motion, within the force and power of motors wherever such exist.

    At each instant of a motion a motor's limit is one of the tension: its force is the tension and what accelerates the
    winch, its power the tension times a speed. Where none exist, and at all other instants, the tensions are the given
    ones.

    - `A`: Wrench matrices with moments over `Robot.length`, (n, 6, m).
    - `case`: Wrenches with the same moments, (n, 6) [N], and their tensions so far, (n, m) [N].
    - `values`: What each limit bounds for these tensions, (n, k) each.
    """
    w, tensions = case
    low, high = scenario.bounds_at(times)
    for limit, its in zip(scenario.limits, values, strict=True):
        if isinstance(limit, WinchForce):
            reflected = its - tensions[:, limit.cables]
            high[:, limit.cables] = np.minimum(high[:, limit.cables], limit.high - reflected)
            low[:, limit.cables] = np.maximum(low[:, limit.cables], -limit.high - reflected)
        elif isinstance(limit, WinchPower):
            slower = limit.high / np.maximum(np.abs(its), limit.high)
            high = np.where(slower < 1, np.minimum(high, slower * tensions), high)
    rows = np.flatnonzero(((tensions > high) | (tensions < low)).any(axis=1) & (low <= high).all(axis=1))
    if not rows.size:
        return tensions
    found = solve_batch(A[rows], w[rows], low[rows], high[rows], tensions[rows])
    chosen = tensions.copy()
    chosen[rows[found.feasible]] = found.tensions[found.feasible]
    return chosen
