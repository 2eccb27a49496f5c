"""Compute the cost of a plan of which only the time law was free, by its task's objective, from its audit: `cost`."""

from ..result import PlanData


def cost(plan: PlanData) -> float:
    """Return the objective of a feasible plan without free coordinates, but for the jerk that it does not have."""
    audit, task = plan.audit, plan.scenario.task
    margin = 0.0 if plan.margin is None else plan.margin - task.margin
    return plan.scenario.costs.along(audit.times, audit.motion, audit.carriers, audit.tensions, margin)
