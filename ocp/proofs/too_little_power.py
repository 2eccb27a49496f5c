"""Prove that no tensions of a fixed motion keep the limit on the power of its winches: `too_little_power`.

The rates of the cables are given, so the power of a winch is proportional to its tension. At each instant a linear
program finds the tensions whose largest power is least. Of faster motions the rates are larger, and the wrench is a
linear function of the square of how many times faster they are, another unknown.
"""

import numpy as np

from ..audits.excess import Excess
from ..limits.cables import WinchPower
from ..tasks.paths import Motion
from ..tasks.scenario import Scenario

PLACES = 41
STEP = 1e-5  # of the duration, over which lengths are compared
CERTAIN = 1e-3  # of the power


def too_little_power(scenario: Scenario, faster: float = 1.0) -> list[Excess]:
    """Return the excess where a fixed motion, or one up to so many times `faster`, requires most power; [] if none."""
    from scipy.optimize import linprog

    hard = (limit for limit in scenario.limits if limit.soft is None and limit.phases is None)
    limit = min((limit for limit in hard if type(limit) is WinchPower), key=lambda limit: limit.high, default=None)
    times = np.linspace(0.0, scenario.duration, PLACES)[1:-1]
    times = times[~scenario.phases.resting(times)]
    if limit is None or not len(times):
        return []
    robot, step = scenario.robot, STEP * scenario.duration
    platform, carriers = scenario.motion(times, None)
    later, sooner = (
        scenario.dynamics.cable_lengths(*(part.pose for part in scenario.motion(times + shift, None)))
        for shift in (step, -step)
    )
    rates = np.abs(later - sooner) / (2 * step)
    scale = robot.wrench_scale * robot.dof_mask / robot.force_scale
    A = scenario.dynamics.wrench_matrix(platform.pose, carriers.pose) * scale[:, None]
    w = scenario.required_wrench(times, platform, carriers, scenario.wind) * scale
    resting, held = Motion.still(platform.pose), Motion.still(carriers.pose)
    d = w - scenario.required_wrench(times, resting, held, scenario.wind) * scale
    low, high = scenario.bounds_at(times)
    cost, worst = np.append(np.zeros(robot.m + 1), 1.0), list[Excess]()
    for k, time in enumerate(times.tolist()):
        rows = np.column_stack([np.diag(rates[k] / limit.high), np.zeros(robot.m), np.full(robot.m, -1.0)])
        bounds = [*zip(low[k], high[k], strict=True), (0.0, faster**2 - 1), (0.0, None)]
        equal = np.column_stack([A[k], -d[k], np.zeros(6)])
        found = linprog(cost, A_ub=rows, b_ub=np.zeros(robot.m), A_eq=equal, b_eq=w[k], bounds=bounds, method="highs")
        if found.success and found.fun > (worst[0].value / limit.high if worst else 1.0 + CERTAIN):
            power, cable = limit.high * found.fun, int((rates[k] * found.x[:-2]).argmax())
            why = "the least that any tensions permit"
            worst = [Excess(limit.name, limit.labels[cable], time, power, limit.high, limit.unit, "at most", why)]
    return worst
