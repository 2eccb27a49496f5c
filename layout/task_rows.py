"""The wrenches that the tasks of a design require along their motions."""

import numpy as np

from ..models import Robot
from ..ocp.tasks.lay_out import lay_out
from ..ocp.tasks.task import Task
from .evaluation import Rows

INSTANTS, FEW_INSTANTS = 41, 9  # of each task, and for annealing


def with_tasks(rows: Rows, robot: Robot, tasks: tuple[Task, ...], count: int = INSTANTS) -> Rows:
    """Return the rows, followed by those of each task that fixes its motion and leaves the carriers at home.

    The wrenches of other tasks depend on the planner's choices, so these tasks are only planned at the end.
    """
    for task in tasks:
        scenario = lay_out(robot, task)
        if not scenario.is_fixed or scenario.carrier_paths:
            continue
        times = np.linspace(0.0, scenario.duration, count)
        motion, carriers = scenario.motion(times, None)
        wrenches = scenario.required_wrench(times, motion, carriers, scenario.wind)
        rows = rows.joined(Rows(motion.pose, np.arange(count), wrenches, motion.acceleration))
    return rows
