"""`Goal`: what a search maximises.

That is the smallest margin or, once that is large enough, how weak the winches are, or the lowest natural frequency.
"""

from typing import NamedTuple

import numpy as np

from ..models.dynamics import dynamics_of
from ..models.elasticity import frequency
from .requirements import Requirements
from .variables import Variables

PRICE = 0.01  # of 1 N of the mean t_max, in newtons of margin: so little that the margin comes first
_SPARE = 0.005  # of the margin: what is searched for more than is required, since audits find less


class Outcome(NamedTuple):
    """The result of a layout."""

    margin: float = -np.inf  # smallest [N]
    missing: float = np.inf  # by how much the worst bound of the room is missed [m]
    frequency: float = 0.0  # lowest natural frequency, if it counts [Hz]


NOTHING = Outcome()  # before any layout is known


class Goal(NamedTuple):
    """The smallest margin counts up to what is wanted; variables have prices, and the lowest frequency a value."""

    wanted: float  # margin [N]; infinite if it is maximised
    price: np.ndarray  # (p,) [N per unit]
    per_hertz: float = 0.0  # [N/Hz]

    @property
    def enough(self) -> float:
        """Return the margin up to which a search counts it [N]."""
        return self.wanted * (1.0 + _SPARE)

    def value(self, margin: float, y: np.ndarray, frequency: float = 0.0) -> float:
        """Return what the linear programs and the annealing maximise [N]."""
        return min(margin, self.enough) + self.per_hertz * frequency - float(self.price @ y)

    def better(self, y: np.ndarray, new: Outcome, than: np.ndarray, old: Outcome) -> bool:
        """Return whether less of the room is missing, or none and it is nearer to the goal: margin first."""
        if new.missing > 0.0 or old.missing > 0.0:
            return (new.missing, -new.margin) < (old.missing, -old.margin)
        return self._rank(y, new) > self._rank(than, old)

    def _rank(self, y: np.ndarray, outcome: Outcome) -> tuple[float, float]:
        return min(outcome.margin, self.wanted), self.per_hertz * outcome.frequency - float(self.price @ y)


def goal_of(variables: Variables, requirements: Requirements) -> Goal:
    """Return the goal of a design."""
    if requirements.maximise == "natural_frequency":
        robot = variables.robot
        lengths = dynamics_of(robot).cable_lengths(robot.home)
        k = sum((cable.stiffness or 0.0) / length for cable, length in zip(robot.cables, lengths, strict=True))
        typical = float(frequency(k / robot.platform.mass))
        return Goal(requirements.margin, np.zeros(variables.size), PRICE * robot.force_scale / typical)
    if requirements.minimise is None:
        return Goal(np.inf, np.zeros(variables.size))
    t_max_by_variables = variables.S[7 * variables.robot.m :]  # (m, p)
    return Goal(requirements.margin, PRICE * t_max_by_variables.mean(axis=0))
