"""Let the platform tilt where it cannot be held in the attitude of its path: `tilting_platform`."""

import numpy as np

from ..result import Relaxed
from ..tasks.lay_out import lay_out
from ..tasks.scenario import ATTITUDE, Scenario
from .relaxations import planned, rounded, solved
from .search import Search

MOST = 0.5  # [rad], of a tilt that is offered
SPARE = 1.01  # times the largest tilt at the nodes


def tilting_platform(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the tube in which the platform must be allowed to tilt, so that few cables can hold it on its path.

    Cables fewer than the degrees of freedom balance the weight in few attitudes, which change from place to place.
    """
    task, robot = scenario.task, scenario.robot
    angles = [axis for axis in ATTITUDE if robot.dof_mask[axis]]
    if task.tube.turn or task.phases is not None or not angles or robot.m >= robot.dof_mask.sum():
        return []

    def with_tilt(most: float) -> Scenario:
        return lay_out(robot, task.model_copy(update={"tube": task.tube.model_copy(update={"attitude": most})}))

    free = with_tilt(MOST)
    outcome = solved(search, free, None)
    if outcome is None:
        return []
    turns = [column for column, (owner, axis) in enumerate(free.owners()) if owner is None and axis in angles]
    tilt = min(rounded(SPARE * float(np.abs(outcome.deviation.q[:, turns]).max()), up=True), MOST)
    if not tilt:
        return []
    plan = planned(search, with_tilt(tilt), "audit, tilting platform", outcome.deviation)
    return [] if plan is None else [Relaxed("tube.attitude", "rad", task.tube.turn, tilt, plan, "about each axis")]
