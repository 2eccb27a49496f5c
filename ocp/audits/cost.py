"""Compute the cost of a plan of which only the time law was free, by its task's objective, from its audit: `cost`."""

from __future__ import annotations

import numpy as np

from ..result import PlanData

__all__ = ["cost"]


def cost(plan: PlanData) -> float:
    """Return the objective of a feasible plan without free coordinates: tensions, their rates, duration and margin."""
    objective, robot, audit = plan.scenario.task.objective, plan.scenario.robot, plan.audit
    total = float(np.mean(np.sum((audit.tensions / (objective.tension or robot.force_scale)) ** 2, axis=1)))
    if objective.tension_rate is not None:
        rates = np.diff(audit.tensions, axis=0) / np.diff(audit.times)[:, None]
        total += float(np.mean(np.sum((rates / objective.tension_rate) ** 2, axis=1)))
    if objective.time is not None:
        total += plan.scenario.duration / objective.time
    if objective.margin is not None and plan.margin is not None:
        total -= (plan.margin - plan.scenario.task.margin) / objective.margin
    return total
