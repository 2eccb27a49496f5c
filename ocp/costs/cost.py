"""`Cost`: a quantity that a plan minimises, averaged over the motion.

A cost is one formula, `values`, of the state at one instant (`CostState`). The objective of a task is the mean over
time of sum (values / amount)^2 over all its costs. So `amount` adds 1 to the objective (Bryson's rule), and a larger
amount makes a cost less important.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import casadi as ca

from ..limits.state import Body, State


@dataclass(frozen=True)
class CostState(State):
    """The state at one instant, in {G}, and the quantities that the planner chooses for the whole motion.

    Attributes:
        offsets: Motions of the platform and of each carrier relative to those that the task gives: the platform's path,
            in the path's axes; the carrier's path, `around`, or home. They are zero in coordinates that are not free.
        duration: Duration of the motion, (1, 1) [s].
        margin: Smallest distance of all planned tensions from their limits, beyond the task's `margin`, (1, 1) [N];
            zero unless the objective rewards it.
    """

    offsets: tuple[Body, ...]
    duration: ca.SX
    margin: ca.SX


class Cost(ABC):
    """A cost: the mean over time of sum (values / amount)^2. Subclass it for a cost of your own.

    Args:
        amount: Amount (default: the class variable).

    Attributes:
        name: Name in messages.
        unit: Unit of values and amount.
        amount: Value that adds 1 to the objective.
        squared: False to sum the values themselves instead of their squares, so negative values are a reward.
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
    """A cost of the rates of change of `values`: programs use their differences from point to point, per second."""
