"""Plan motions that keep every tension inside its limits: tasks, the planner, its audit, plans and time laws."""

from typing import TYPE_CHECKING, Any

from ..base.former_names import moved_name
from .plan import Plan
from .planner import Planner, plan
from .sweeps.result import Sweep
from .sweeps.run import sweep
from .tasks.task import MotionStatus, Task, read_task
from .timing.time_along import time_along

__all__ = ["MotionStatus", "Plan", "Planner", "Sweep", "Task", "plan", "read_task", "sweep", "time_along"]


if not TYPE_CHECKING:  # a type checker would accept any name

    def __getattr__(name: str) -> Any:
        """Return the object of a former name."""
        return moved_name("ocp", name)
