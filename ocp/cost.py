"""`cost`: what a plan costs by its task's objective, from what the audit saw; where only its pace was free."""

from __future__ import annotations

import numpy as np

from .result import Plan

__all__ = ["cost"]


def cost(found: Plan) -> float:
    """The objective of a feasible plan without free coordinates: tensions, their rates, duration and margin."""
    objective, robot, seen = found.scenario.task.objective, found.scenario.robot, found.audit
    total = float(np.mean(np.sum((seen.tensions / (objective.tension or robot.force_scale)) ** 2, axis=1)))
    if objective.tension_rate is not None:
        rates = np.diff(seen.tensions, axis=0) / np.diff(seen.times)[:, None]
        total += float(np.mean(np.sum((rates / objective.tension_rate) ** 2, axis=1)))
    if objective.time is not None:
        total += found.scenario.duration / objective.time
    if objective.margin is not None and found.margin is not None:
        total -= (found.margin - found.scenario.task.margin) / objective.margin
    return total
