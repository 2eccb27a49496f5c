"""`relative_violation`: how far a motion is from being feasible, as one number, to compare motions by."""

import numpy as np

from ..result import PlanData
from ..tasks.scenario import Scenario
from .audit import Audit
from .excess import Excess


def relative_violation(scenario: Scenario, audit: Audit) -> float:
    """Return the largest violation of any limit, relative to that limit; zero if the audit passed.

    A missing wrench is relative to `Robot.force_scale`. An excess over a limit of zero is relative to the same force or
    to `Robot.length`, by its unit. A value that is undefined is an infinite violation.
    """
    if audit.passed:
        return 0.0
    missing = float(audit.violation.max())
    shares = [missing / scenario.robot.force_scale if missing > audit.tolerance else 0.0]
    shares += [_share(scenario, excess) for excess in audit.excess]
    return max(shares)


def _share(scenario: Scenario, excess: Excess) -> float:
    """Return an excess relative to its bound, or to the robot's scale of its unit; times are in seconds."""
    if not np.isfinite(excess.value):
        return np.inf
    length, force = scenario.robot.length, scenario.robot.force_scale
    quantity = excess.unit.partition("/")[0].partition(",")[0].strip()
    scale = {"m": length, "N": force, "N m": force * length}.get(quantity, 1.0)
    return abs(excess.value - excess.bound) / (abs(excess.bound) or scale)


def cost(plan: PlanData) -> float:
    """Return the objective of a feasible plan without free coordinates, but for the jerk that it does not have."""
    audit, task = plan.audit, plan.scenario.task
    margin = 0.0 if plan.margin is None else plan.margin - task.margin
    costs = plan.scenario.costs.along(audit.times, audit.motion, audit.carriers, audit.tensions, margin)
    return costs + _of_soft_limits(plan.scenario, audit)


def _of_soft_limits(scenario: Scenario, audit: Audit) -> float:
    """Return what exceeding the soft limits costs: at each instant the largest excess over those of one name."""
    beyond: dict[str, np.ndarray] = {}
    soft = [limit for limit in scenario.limits if limit.soft is not None]
    for limit, values in zip(soft, audit.limiting(limits=soft) if soft else [], strict=True):
        excess = np.maximum(limit.low - values, values - limit.high).max(axis=1) / limit.soft
        beyond[limit.name] = np.fmax(beyond.get(limit.name, 0.0), excess)  # nan: not in force
    return float(sum((each**2).mean() for each in beyond.values()))
