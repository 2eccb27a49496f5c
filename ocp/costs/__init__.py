"""Costs of a motion, one class each: the terms of a task's objective. `Cost` is their base class."""

from .cost import Cost, CostState, RateCost

__all__ = ["Cost", "CostState", "RateCost"]
