"""`Cost`: what a plan makes small, averaged over the motion.

A cost is one formula, `values`, of everything that there is at one instant (`CostState`). The objective of a task is
the mean over time of sum (values / amount)^2 over all its costs. So `amount` is what adds one (Bryson's rule), and a
larger one makes a cost less important.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import casadi as ca

from ..limits.state import Body, State


@dataclass(frozen=True)
class CostState(State):
    """Everything that there is at one instant, in {G}, and what the planner chooses for the whole motion.

    Attributes
    ----------
    offsets
        The motions of the platform and of each carrier relative to those that the task gives: the platform's path, in
        the path's axes; the carrier's path, `around`, or home. They are zero in coordinates that are not free.
    duration
        Of the whole motion, (1, 1) [s].
    margin
        The least distance of all planned tensions from their limits, beyond the task's `margin`, (1, 1) [N]; zero
        unless the objective rewards it.
    """

    offsets: tuple[Body, ...]
    duration: ca.SX
    margin: ca.SX


class Cost(ABC):
    """A cost: the mean over time of sum (values / amount)^2. Subclass it for a cost of your own.

    Parameters
    ----------
    amount
        Default: that of the class.

    Attributes
    ----------
    name
        Its name in messages.
    unit
        The unit of values and amount.
    amount
        The value that adds one to the objective.
    squared
        False: the values themselves add up, not their squares, so that negative ones are a reward.
    """

    name: str = "cost"
    unit: str = ""
    amount: float = 1.0
    squared: bool = True

    def __init__(self, amount: float | None = None):
        if amount is not None:
            self.amount = amount

    @abstractmethod
    def values(self, state: CostState) -> ca.SX:
        """Return the values at one instant, (k, 1), as an expression of its symbols."""


class RateCost(Cost):
    """A cost of how fast `values` change: programs take their differences from point to point, per second."""
