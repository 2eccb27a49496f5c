"""`Pending`: accelerations that are commanded and not there yet."""

from __future__ import annotations

from collections import deque

import numpy as np

__all__ = ["Pending"]


class Pending:
    """Remember commands for as long as they take to come true, a number of stages."""

    def __init__(self, late: int, stage: float):
        self._late, self._stage = late, stage
        self.reset(0)

    def reset(self, count: int) -> None:
        """Forget all commands, of accelerations in `count` coordinates."""
        self._time, self._count = 0.0, count
        self._commands: deque[tuple[float, np.ndarray]] = deque()

    def wait(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self._time += dt

    def add(self, acceleration: np.ndarray) -> None:
        """Command accelerations, (f,), from now on."""
        self._commands.append((self._time, acceleration.copy()))

    def means(self) -> np.ndarray:
        """Return the mean accelerations in each stage from now on, (late, f); zeros for what was not commanded."""
        result, commands = np.zeros((self._late, self._count)), self._commands
        first = self._time - self._late * self._stage
        while len(commands) > 1 and commands[1][0] <= first:
            commands.popleft()
        if commands:
            begins, values = np.array([each[0] for each in commands]), np.array([each[1] for each in commands])
            ends = np.append(begins[1:], self._time)
            low = first + self._stage * np.arange(self._late)[:, None]
            overlap = np.minimum(ends, low + self._stage) - np.maximum(begins, low)
            result = np.maximum(overlap, 0.0) @ values / self._stage
        return result
