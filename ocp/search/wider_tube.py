"""Offer the tube that a motion needs: wide enough for given states, or for the tilt of a platform on few cables."""

import numpy as np

from ..audits.audit import Audit
from ..result import Relaxed
from ..tasks.lay_out import with_task
from ..tasks.scenario import ATTITUDE, Scenario
from .relaxations import BEYOND, planned, rounded, solved
from .search import Search

MOST = 0.5  # [rad], of a tilt that is offered
SPARE = 1.01  # times the largest tilt at the nodes


def as_wide_as_states(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the radius of the tube that reaches the given state farthest outside it."""
    tube = scenario.task.tube
    off = max((excess.value for excess in audit.excess if excess.limit == "tube.position"), default=0.0)
    if off <= tube.radius:
        return []
    radius = rounded((1 + BEYOND) * off, up=True)
    plan = planned(search, _with_tube(scenario, position=radius), "audit, wider tube")
    return [] if plan is None else [Relaxed("tube.position", "m", tube.radius, radius, plan)]


def tilting_platform(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the tube in which the platform must be allowed to tilt, so that few cables can hold it on its path.

    Cables fewer than the degrees of freedom balance the weight in few attitudes, which change from place to place.
    """
    task, robot = scenario.task, scenario.robot
    angles = [axis for axis in ATTITUDE if robot.dof_mask[axis]]
    if task.tube.turn or task.phases is not None or not angles or robot.m >= robot.dof_mask.sum():
        return []
    free = _with_tube(scenario, attitude=MOST)
    outcome = solved(search, free, None)
    if outcome is None:
        return []
    turns = [column for column, (owner, axis) in enumerate(free.owners()) if owner is None and axis in angles]
    tilt = min(rounded(SPARE * float(np.abs(outcome.deviation.q[:, turns]).max()), up=True), MOST)
    if not tilt:
        return []
    tilting = _with_tube(scenario, attitude=tilt)
    plan = planned(search, tilting, "audit, tilting platform", outcome.deviation)
    return [] if plan is None else [Relaxed("tube.attitude", "rad", task.tube.turn, tilt, plan, "about each axis")]


def _with_tube(scenario: Scenario, **changes: float) -> Scenario:
    return with_task(scenario, tube=scenario.task.tube.model_copy(update=changes))
