"""`Extremes`: what is kept of each of many flights: errors, extreme tensions, slack, and how steps were answered."""

from __future__ import annotations

import numpy as np

from ..control import ANSWERS
from .conditions import Conditions
from .recorder import Period

__all__ = ["Extremes"]


class Extremes:
    """Keep a few numbers of each flight while it is flown.

    Attributes
    ----------
    squares, error_max
        Sum of the squared errors of the position, and the largest error [m], (N,).
    tension_min, tension_max
        Extreme tensions [N], (N,).
    slack
        How many periods begin with a slack cable that should pull, (N,).
    exceeded
        By how much tensions are above their upper limits at most, in proportion to the cable's range, (N,).
    answers
        How many steps were answered in each way of `ANSWERS`, (N, 4).
    """

    def __init__(self, conditions: Conditions, t_min: np.ndarray, t_max: np.ndarray, flights: int):
        self._references, self._t_max, self._range = conditions.references, t_max, t_max - t_min
        self._taut = conditions.should_pull(t_min, np.arange(len(conditions.references)))
        self._rows = np.arange(flights)
        self.squares, self.error_max, self.slack = np.zeros(flights), np.zeros(flights), np.zeros(flights, dtype=int)
        self.tension_min, self.tension_max = np.full(flights, np.inf), np.full(flights, -np.inf)
        self.exceeded = np.zeros(flights)
        self.answers = np.zeros((flights, len(ANSWERS)), dtype=int)

    def take(self, period: Period) -> None:
        """Keep a period."""
        alive, command = period.alive, period.command
        rows = slice(None) if alive.all() else np.flatnonzero(alive)
        motions, tensions = period.motions[rows], period.tensions[rows]
        off = motions[:, 0, :3] - self._references[period.number].pose[:3]
        square = np.einsum("ij,ij->i", off, off)
        self.squares[rows] += square
        self.error_max[rows] = np.maximum(self.error_max[rows], np.sqrt(square))
        self.tension_min[rows] = np.minimum(self.tension_min[rows], tensions.min(axis=1))
        self.tension_max[rows] = np.maximum(self.tension_max[rows], tensions.max(axis=1))
        above = ((tensions - self._t_max) / self._range).max(axis=1)
        self.exceeded[rows] = np.maximum(self.exceeded[rows], above)
        self.slack[rows] += ((tensions <= 0) & self._taut[period.number]).any(axis=1)
        self.answers[self._rows[rows], np.broadcast_to(command.answered, len(self._rows))[rows]] += 1
