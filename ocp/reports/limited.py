"""`limited`: the limited quantities of a plan, except tensions, as curves over time with their bounds."""

import numpy as np

from ...figures.limits import Limited
from ..result import PlanData


def limited(plan: PlanData, rows: np.ndarray) -> list[Limited]:
    """Return the limits of task, robot and carriers at the audit's `rows`, those of one name and bound together."""
    gathered: dict[tuple[str, str, float, float], tuple[list[str], list[np.ndarray]]] = {}
    for limit, values in zip(plan.scenario.limits, plan.audit.limited, strict=True):
        if limit.shown:
            labels, curves = gathered.setdefault((limit.title, limit.unit, limit.low, limit.high), ([], []))
            labels += limit.labels
            curves.append(values[rows])
    return [
        Limited(name, unit, labels, np.hstack(curves), low, high)
        for (name, unit, low, high), (labels, curves) in gathered.items()
    ]
