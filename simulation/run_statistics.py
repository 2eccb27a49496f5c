"""`Extremes`: statistics of each of many runs: errors, extreme tensions, slack, and the status of control steps."""

import numpy as np

from ..control import ANSWERS
from ..control.command import PLANNED
from .experiment import Experiment
from .recorder import Period


class Extremes:
    """Accumulate per-run statistics.

    Each period takes a few operations on whole arrays. The properties reduce them to one number per run.

    Attributes
    ----------
    squares
        Sum of the squared position errors [m^2], (N,).
    slack
        Number of periods that begin with a slack cable whose t_min is above zero, (N,).
    answers
        Number of control steps with each status of `ANSWERS`, (N, 5).
    """

    def __init__(self, conditions: Experiment, t_min: np.ndarray, t_max: np.ndarray, flights: int):
        self._references, self._t_max, self._range = conditions.references, t_max, t_max - t_min
        periods = np.arange(len(conditions.references))
        self._taut = conditions.should_pull(t_min, periods)
        self._cut = conditions.cut(len(t_min), periods + 1)  # also inside the period
        self._rows = np.arange(flights)
        self.squares, self.slack = np.zeros(flights), np.zeros(flights, dtype=int)
        self.answers = np.zeros((flights, len(ANSWERS)), dtype=int)
        self._largest = np.zeros(flights)  # squared error
        self._least, self._most = np.full((flights, len(t_max)), np.inf), np.full((flights, len(t_max)), -np.inf)

    def take(self, period: Period) -> None:
        """Keep a period."""
        alive, command = period.alive, period.command
        rows = slice(None) if alive.all() else np.flatnonzero(alive)
        tensions = period.tensions[rows]
        off = period.motions[rows, 0, :3] - self._references[period.number].pose[:3]
        off *= off
        square = off[:, 0] + off[:, 1] + off[:, 2]
        self.squares[rows] += square
        self._largest[rows] = np.maximum(self._largest[rows], square)
        whole = ~self._cut[period.number]
        self._least[rows] = np.minimum(self._least[rows], tensions, where=whole, out=self._least[rows])
        self._most[rows] = np.maximum(self._most[rows], tensions, where=whole, out=self._most[rows])
        if not tensions.min() > 0:
            self.slack[rows] += ((tensions <= 0) & self._taut[period.number]).any(axis=1)
        answered = np.atleast_1d(command.answered)[rows]
        if answered.any():
            self.answers[self._rows[rows], answered] += 1
        else:
            self.answers[rows, PLANNED] += 1

    @property
    def error_max(self) -> np.ndarray:
        """Return the largest position error [m], (N,)."""
        return np.sqrt(self._largest)

    @property
    def tension_min(self) -> np.ndarray:
        """Return the smallest tension of cables that are not cut [N], (N,); 0 if all are."""
        least = self._least.min(axis=1)
        return np.where(np.isinf(least), 0.0, least)

    @property
    def tension_max(self) -> np.ndarray:
        """Return the largest tension of cables that are not cut [N], (N,); 0 if all are."""
        most = self._most.max(axis=1)
        return np.where(np.isinf(most), 0.0, most)

    @property
    def exceeded(self) -> np.ndarray:
        """Return the largest excess of tensions over t_max relative to the cable's range, at least 0, (N,)."""
        return np.maximum(((self._most - self._t_max) / self._range).max(axis=1), 0.0)
