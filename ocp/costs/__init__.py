"""Costs of a motion, one class each: what the objective of a task sums. `Cost` is the base of them all."""

from .cost import Cost, CostState, RateCost

__all__ = ["Cost", "CostState", "RateCost"]
