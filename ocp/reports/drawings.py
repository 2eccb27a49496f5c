"""`drawings`: all figures of a plan by name, as `Plan.plot` saves and the report's page shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...figures import plan as plan_figures
from ...figures.drawing import Drawing
from ...figures.limits import limits
from ...figures.plan import convergence, phase_plane
from ...figures.views import views
from ...statics.scene import scene
from ..result import PlanData
from .trajectory import output_rows

if TYPE_CHECKING:
    import xarray as xr
from ...figures.limits import Limited

INSTANTS = 60  # along the carriers' paths in the views


def drawings(plan: PlanData, trajectory: xr.Dataset) -> dict[str, Drawing]:
    """Return the figures by the names of their files, without suffix; a figure without content is left out."""
    times = np.linspace(0.0, plan.scenario.duration, INSTANTS)
    drawn = {
        "views": Drawing("Path, with the robot at both ends", views(scene(plan.scenario.robot, trajectory, times))),
        "tensions": Drawing("Tensions against their limits", plan_figures.tensions(trajectory)),
    }
    if plan.law is not None and plan.law.exists:
        active = [(each.start, each.end, each.limit) for each in plan.law.bottlenecks]
        drawn["law"] = Drawing(
            "The fastest time law and its active limits", phase_plane(plan.law.s, plan.law.sd, active)
        )
    if trajectory["carrier_moves"].any():
        drawn["path"] = Drawing("Path of the platform and positions of the carriers", plan_figures.path(trajectory))
        drawn["base"] = Drawing("Carriers relative to the platform", plan_figures.base_offset(trajectory))
    rows = output_rows(plan)
    quantities = limited(plan, rows)
    if any(each.used() is not None for each in quantities):
        drawn["limits"] = Drawing("Other limits", limits(plan.audit.times[rows], quantities))
    if plan.iterates:
        drawn["convergence"] = Drawing("Convergence of the solver", convergence(plan.iterates))
    return drawn


def limited(plan: PlanData, rows: np.ndarray) -> list[Limited]:
    """Return the limits of task, robot and carriers at the audit's `rows`, limits of one name and bound together."""
    gathered: dict[tuple[str, str, float, float], tuple[list[str], list[np.ndarray]]] = {}
    shown = [limit for limit in plan.scenario.limits if limit.shown]
    for limit, values in zip(shown, plan.audit.limiting(rows, shown), strict=True):
        labels, curves = gathered.setdefault((limit.title, limit.unit, limit.low, limit.high), ([], []))
        labels += limit.labels
        curves.append(values)
    return [
        Limited(name, unit, labels, np.hstack(curves), low, high)
        for (name, unit, low, high), (labels, curves) in gathered.items()
    ]
