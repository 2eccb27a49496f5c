"""`Goal`: what a search maximises.

That is the smallest margin or, once that is large enough, how weak the winches are, how little cables and winches cost,
or the lowest natural frequency.
"""

from typing import NamedTuple

import numpy as np

from ..models.dynamics import dynamics_of
from ..models.elasticity import frequency
from .requirements import Requirements
from .variables import Variables

_PRICE = 0.01  # of 1 N of the mean t_max, in newtons of margin: so little that the margin comes first
_SPARE = 0.005  # of the margin: what is searched for more than is required, since audits find less


class Outcome(NamedTuple):
    """The result of a layout."""

    margin: float = -np.inf  # smallest [N]
    missing: float = np.inf  # by how much the worst bound of the room is missed [m]
    frequency: float = 0.0  # lowest natural frequency, if it counts [Hz]
    cable: float = 0.0  # sum of the longest lengths of all cables, if it counts [m]


NOTHING = Outcome()  # before any layout is known


class Goal(NamedTuple):
    """The smallest margin counts up to what is wanted; variables and cable have prices, the frequency a value."""

    wanted: float  # margin [N]; infinite if it is maximised
    price: np.ndarray  # (p,) [N per unit]
    unit: float = 1.0  # newtons of margin that one unit of what is improved is worth: of t_max, cost or frequency
    unit_text: str = "N"
    per_hertz: float = 0.0  # [N/Hz]
    per_metre: float = 0.0  # of cable [N/m]

    @property
    def enough(self) -> float:
        """Return the margin up to which a search counts it [N]."""
        return self.wanted * (1.0 + _SPARE)

    def value(self, y: np.ndarray, outcome: Outcome) -> float:
        """Return what the linear programs and the annealing maximise [N]."""
        return min(outcome.margin, self.enough) + self._besides(y, outcome)

    def better(self, y: np.ndarray, new: Outcome, than: np.ndarray, old: Outcome) -> bool:
        """Return whether less of the room is missing, or none and it is nearer to the goal: margin first."""
        if new.missing > 0.0 or old.missing > 0.0:
            return (new.missing, -new.margin) < (old.missing, -old.margin)
        return self._rank(y, new) > self._rank(than, old)

    def _rank(self, y: np.ndarray, outcome: Outcome) -> tuple[float, float]:
        return min(outcome.margin, self.wanted), self._besides(y, outcome)

    def _besides(self, y: np.ndarray, outcome: Outcome) -> float:
        return self.per_hertz * outcome.frequency - self.per_metre * outcome.cable - float(self.price @ y)


def goal_of(variables: Variables, requirements: Requirements) -> Goal:
    """Return the goal of a design."""
    robot, margin, nothing = variables.robot, requirements.margin, np.zeros(variables.size)
    lengths = dynamics_of(robot).cable_lengths(robot.home)
    t_max_by_variables = variables.S[7 * robot.m :]  # (m, p)
    if requirements.maximise == "natural_frequency":
        k = sum((cable.stiffness or 0.0) / length for cable, length in zip(robot.cables, lengths, strict=True))
        typical = float(frequency(k / robot.platform.mass))
        per_hertz = _PRICE * robot.force_scale / typical
        return Goal(margin, nothing, per_hertz, "Hz", per_hertz=per_hertz)
    if (prices := requirements.prices) is not None:
        unit = _PRICE * robot.force_scale / prices.cost(robot, float(lengths.sum()))
        price = unit * prices.t_max * t_max_by_variables.sum(axis=0)
        return Goal(margin, price, unit, "1", per_metre=unit * prices.cable)
    if requirements.minimise == "t_max":
        return Goal(margin, _PRICE * t_max_by_variables.mean(axis=0), _PRICE)
    return Goal(np.inf, nothing)
