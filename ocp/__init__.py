"""Trajectories that keep every tension inside its limits: tasks, the planner, its audit, and plans."""

from .plan import Planner, plan
from .result import Plan, PlanStatus
from .task import Task, read_task

__all__ = ["Plan", "PlanStatus", "Planner", "Task", "plan", "read_task"]
