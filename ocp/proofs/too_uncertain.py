"""Prove that no tensions of a fixed motion keep their limits for a share of uncertain robots: `too_uncertain`.

The tensions of other robots differ from planned ones by changes that are normally distributed, and linear in the
planned ones (`towline.statics.robust`). For a share P of the robots a tension keeps a limit only if it is at least k
standard deviations away from it, k the quantile P of the normal distribution. A standard deviation is a norm, nowhere
below its tangent planes, so a linear program with such planes finds no less distance than there is.
"""

import numpy as np

from ...base.text import quantity
from ...statics.robust import Spread
from ..audits.excess import Excess
from ..audits.robust_margin import closest_to_limit
from ..audits.tensions import scaled, tolerance_of
from ..tasks.scenario import Scenario

PLACES = 41
PLANES = 10  # rounds in which the tangent planes of all cables are added
TINY = 1e-300  # [N]


def too_uncertain(scenario: Scenario, share: float) -> list[Excess]:
    """Return the excess at the instant of a fixed motion that is farthest from being possible; [] if none is proven."""
    from scipy.optimize import linprog
    from scipy.special import ndtri

    times = np.linspace(0.0, scenario.duration, PLACES)
    times = times[~scenario.phases.resting(times)]
    if not scenario.is_fixed or scenario.wind_set is not None or not len(times):
        return []
    robot, k, m = scenario.robot, float(ndtri(share)), scenario.robot.m
    platform, carriers = scenario.motion(times, None)
    A = scaled(scenario, scenario.dynamics.wrench_matrix(platform.pose, carriers.pose))
    w = scaled(scenario, scenario.required_wrench(times, platform, carriers, scenario.wind))
    low, high = scenario.bounds_at(times)
    spread, each = Spread(robot, platform.pose, carriers.pose), np.eye(m)
    changes = k * np.stack([spread.changes(np.broadcast_to(one, (len(times), m))) for one in each], axis=-1)
    cost, unit = np.append(np.zeros(m), -1.0), robot.force_scale
    worst, farthest = list[Excess](), -tolerance_of(robot)
    for row, time in enumerate(times.tolist()):
        # Unknown are the tensions, in units of the robot's force, and the least of their distances from the limits.
        rows, bounds = np.zeros((0, m + 1)), np.zeros(0)
        equal, slopes = np.column_stack([A[row], np.zeros(6)]), np.zeros((m, m))
        for _ in range(PLANES if k > 0 else 0):
            planes = np.vstack([slopes - each, slopes + each])
            rows = np.vstack([rows, np.column_stack([planes, np.ones(2 * m)])])
            bounds = np.concatenate([bounds, -low[row] / unit, high[row] / unit])
            found = linprog(cost, rows, bounds, equal, w[row] / unit, (None, None), method="highs")
            if not found.success:
                break
            tensions, distance = found.x[:-1] * unit, float(found.x[-1] * unit)
            change = changes[row] @ tensions  # (m, r)
            reach = np.linalg.norm(change, axis=1)
            if distance < farthest:
                why = f"; whatever the tensions, one is too close to a limit by {quantity(-distance, 'N')} or more"
                worst = [closest_to_limit(time, tensions, reach, low[row], high[row], share, why)]
                farthest = distance
                break
            if (np.minimum(tensions - low[row], high[row] - tensions) - reach).min() >= farthest:
                break
            slopes = np.einsum("mr,mrj->mj", change / np.maximum(reach, TINY)[:, None], changes[row])
    return worst
