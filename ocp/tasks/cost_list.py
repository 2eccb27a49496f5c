"""List the costs of a task: those of its `objective`, and those of the user's own."""

import numpy as np

from ...models import Robot
from ..costs.cost import Cost
from ..costs.costs import Costs
from ..costs.terms import CarrierAcceleration, CarrierOffset, Jerk, Margin, PathDeviation, Tension, TensionRate, Time
from .task import Task


def cost_list(robot: Robot, task: Task) -> Costs:
    """Return the costs of `task`."""
    objective = task.objective
    costs: list[Cost] = [
        Tension(objective.tension or robot.force_scale),
        CarrierOffset(objective.carrier_offset),
        CarrierAcceleration(objective.carrier_acceleration),
        Jerk(objective.jerk),
    ]
    deviation = objective.deviation or _tenth_of_tube(robot, task)
    if 0 < deviation < np.inf:
        costs.append(PathDeviation(deviation))
    for kind, amount in ((TensionRate, objective.tension_rate), (Time, objective.time), (Margin, objective.margin)):
        if amount is not None:
            costs.append(kind(amount))
    return Costs(robot, (*costs, *objective.own))


def _tenth_of_tube(robot: Robot, task: Task) -> float:
    turn = 0.0 if task.tube.attitude == "free" else task.tube.turn
    return 0.1 * max(task.tube.radius, robot.length * turn)
