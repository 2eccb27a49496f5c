"""Trajectories that keep every tension inside its limits: tasks, the planner, its audit, and plans; timing."""

from .plan import Plan
from .planner import Planner, plan
from .sweeps.result import Sweep
from .sweeps.run import sweep
from .tasks.status import MotionStatus
from .tasks.task import Task, read_task
from .timing.fastest_law import time_along
from .timing.timing import Timing

__all__ = [
    "MotionStatus",
    "Plan",
    "Planner",
    "Sweep",
    "Task",
    "Timing",
    "plan",
    "read_task",
    "sweep",
    "time_along",
]
