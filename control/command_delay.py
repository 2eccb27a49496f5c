"""`Pending`: a queue of commands that have not taken effect yet, or are not visible in measurements yet."""

from collections import deque

import numpy as np


class Pending:
    """Remember commands for `kept` [s]."""

    def __init__(self, kept: float):
        self._kept = kept
        self.reset(0)

    def reset(self, count: int) -> None:
        """Forget all commands, of `count` numbers each."""
        self._time, self._count = 0.0, count
        self._commands: deque[tuple[float, np.ndarray]] = deque()

    def wait(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self._time += dt

    def add(self, command: np.ndarray) -> None:
        """Add a command, (count,), from now on; the array is kept."""
        commands = self._commands
        commands.append((self._time, command))
        while len(commands) > 1 and commands[1][0] <= self._time - self._kept:
            commands.popleft()

    def means(self, ago: float, parts: int, part: float) -> np.ndarray:
        """Return mean commands, (parts, count), in parts of `part` [s], from `ago` [s] before now on.

        What was not commanded is zero.
        """
        result, commands = np.zeros((parts, self._count)), self._commands
        if commands:
            begins, values = np.array([each[0] for each in commands]), np.array([each[1] for each in commands])
            ends = np.append(begins[1:], self._time)
            low = self._time - ago + part * np.arange(parts)[:, None]
            overlap = np.minimum(ends, low + part) - np.maximum(begins, low)
            result = np.maximum(overlap, 0.0) @ values / part
        return result
