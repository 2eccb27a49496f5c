"""`within_motors`: other tensions of a motion where those of least norm are too much for the motors of winches."""

import numpy as np

from ...solvers import solve_batch
from ..limits.cables import WinchForce, WinchPower
from ..tasks.scenario import Scenario

SPARES = 0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2  # of the weight: what exceeds motors where that is necessary, in order


def within_motors(
    scenario: Scenario, times: np.ndarray, A: np.ndarray, case: tuple[np.ndarray, np.ndarray], values: list[np.ndarray]
) -> np.ndarray:
    """Return the tensions (n, m) [N] of a motion, within the force and power of motors wherever such exist.

    At each instant of a motion a motor's limit is one of the tension: its force is the tension and what accelerates the
    winch, its power the tension times a speed. Where none exist, they exceed what motors can by little, if such exist;
    at all other instants the tensions are the given ones.

    - `A`: Wrench matrices with moments over `Robot.length`, (n, 6, m).
    - `case`: Wrenches with the same moments, (n, 6) [N], and their tensions so far, (n, m) [N].
    - `values`: What each limit bounds for these tensions, (n, k) each.
    """
    w, tensions = case
    low, high = scenario.bounds_at(times)
    least, most = np.full_like(low, -np.inf), np.full_like(high, np.inf)  # that motors permit
    for limit, its in zip(scenario.limits, values, strict=True):
        if isinstance(limit, WinchForce):
            reflected = its - tensions[:, limit.cables]
            most[:, limit.cables] = limit.high - reflected
            least[:, limit.cables] = -limit.high - reflected
        elif isinstance(limit, WinchPower) and limit.soft is None:
            held = scenario.in_force(limit, times)[:, None] & (its != 0)
            own = np.divide(limit.high * tensions, np.abs(its), np.full_like(most, np.inf), where=held)
            most = np.minimum(most, own)
    exceeded = np.any((tensions > np.minimum(high, most)) | (tensions < np.maximum(low, least)), axis=1)
    if not exceeded.any():
        return tensions
    chosen = tensions.copy()
    for spare in SPARES:
        by = spare * scenario.robot.force_scale
        lowest, highest = np.maximum(low, least - by), np.minimum(high, most + by)
        rows = np.flatnonzero(exceeded & (lowest <= highest).all(axis=1))
        if rows.size:
            found = solve_batch(A[rows], w[rows], lowest[rows], highest[rows], tensions[rows])
            chosen[rows[found.feasible]] = found.tensions[found.feasible]
            exceeded[rows[found.feasible]] = False
    return chosen
