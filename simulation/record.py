"""`Record`: all that happens in one flight."""

from __future__ import annotations

import numpy as np

from ..control import Command

__all__ = ["Record"]


class Record:
    """Keep motions, lengths, tensions and commands of one flight, a row for each period."""

    def __init__(self, periods: int, carriers: int, m: int):
        self.motions = np.full((periods, 1 + carriers, 12), np.nan)
        self.lengths, self.tensions, self.commanded = (np.full((periods, m), np.nan) for _ in range(3))
        self.answered = np.zeros(periods, dtype=np.int8)
        self.direction, self.shortfall = np.full((periods, 6), np.nan), np.full(periods, np.nan)
        self.orders = np.full((periods, carriers, 6), np.nan)

    def take(
        self,
        k: int,
        alive: np.ndarray,
        motions: np.ndarray,
        lengths: np.ndarray,
        tensions: np.ndarray,
        command: Command,
    ) -> None:
        """Keep a period; see `flying.Recorder`."""
        self.motions[k], self.lengths[k], self.tensions[k] = motions[0], lengths[0, 0], tensions[0]
        self.commanded[k], self.answered[k], self.orders[k] = command.tensions, command.answered, command.carrier_pose
        if command.answered:
            self.direction[k], self.shortfall[k] = command.direction, command.shortfall
