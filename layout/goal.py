"""`Goal`: what a search maximises: the smallest margin or, once that is large enough, how weak the winches are."""

from typing import NamedTuple

import numpy as np

from .requirements import Requirements
from .variables import Variables

PRICE = 0.01  # of 1 N of the mean t_max, in newtons of margin: so little that the margin comes first
_SPARE = 0.005  # of the margin: what is searched for more than is required, since audits find less


class Outcome(NamedTuple):
    """The result of a layout."""

    margin: float = -np.inf  # smallest [N]
    missing: float = np.inf  # by how much the worst bound of the room is missed [m]


NOTHING = Outcome()  # before any layout is known


class Goal(NamedTuple):
    """The smallest margin counts up to what is wanted, and variables have prices."""

    wanted: float  # margin [N]; infinite if it is maximised
    price: np.ndarray  # (p,) [N per unit]

    @property
    def enough(self) -> float:
        """Return the margin up to which a search counts it [N]."""
        return self.wanted * (1.0 + _SPARE)

    def value(self, y: np.ndarray, margin: float) -> float:
        """Return what the linear programs and the annealing maximise [N]."""
        return min(margin, self.enough) - float(self.price @ y)

    def better(self, y: np.ndarray, new: Outcome, than: np.ndarray, old: Outcome) -> bool:
        """Return whether less of the room is missing, or none and it is nearer to the goal: margin first."""
        if new.missing > 0.0 or old.missing > 0.0:
            return (new.missing, -new.margin) < (old.missing, -old.margin)
        return self._rank(y, new) > self._rank(than, old)

    def _rank(self, y: np.ndarray, outcome: Outcome) -> tuple[float, float]:
        return min(outcome.margin, self.wanted), -float(self.price @ y)


def goal_of(variables: Variables, requirements: Requirements) -> Goal:
    """Return the goal of a design."""
    if requirements.minimise == "t_max":
        return Goal(requirements.margin, PRICE * variables.S[7 * variables.robot.m :].mean(axis=0))
    return Goal(np.inf, np.zeros(variables.size))
