"""`Goal`: what a search maximises: the smallest margin, or how weak the winches are once the margin is large enough."""

from typing import NamedTuple

import numpy as np

from .requirements import Requirements
from .variables import Variables

PRICE = 0.01  # of 1 N of the mean t_max, in newtons of margin: so little that the margin comes first
_SPARE = 0.005  # of the margin: what is searched for more than is required, since audits find less


class Goal(NamedTuple):
    """The smallest margin counts up to what is wanted; the variables have prices."""

    wanted: float  # margin [N]; infinite if it is maximised
    price: np.ndarray  # (p,) [N per unit]

    @property
    def enough(self) -> float:
        """Return the margin up to which a search counts it [N]."""
        return self.wanted * (1.0 + _SPARE)

    def value(self, margin: float, y: np.ndarray) -> float:
        """Return what the linear programs and the annealing maximise [N]."""
        return min(margin, self.enough) - float(self.price @ y)

    def rank(self, margin: float, y: np.ndarray) -> tuple[float, float]:
        """Return what is larger for a better layout: the margin as far as it is wanted comes first."""
        return min(margin, self.wanted), -float(self.price @ y)


def goal_of(variables: Variables, requirements: Requirements) -> Goal:
    """Return the goal of a design."""
    if requirements.minimise is None:
        return Goal(np.inf, np.zeros(variables.size))
    t_max_by_variables = variables.S[7 * variables.robot.m :]  # (m, p)
    return Goal(requirements.margin, PRICE * t_max_by_variables.mean(axis=0))
