"""`Pending`: a queue of commands that have not taken effect yet, or are not visible in measurements yet."""

from collections import deque

import numpy as np

MANY = 64  # commands in a queue before old ones are looked for


class Pending:
    """Remember commands for `kept` [s]."""

    def __init__(self, kept: float):
        self._kept = kept
        self.reset(0)

    def reset(self, count: int) -> None:
        """Forget all commands, of `count` numbers each."""
        self._time, self._count, self._many = 0.0, count, MANY
        self._commands: deque[tuple[float, bytes]] = deque()

    def wait(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self._time += dt

    def add(self, command: bytes) -> None:
        """Add a command from now on, the bytes of (count,) numbers."""
        self._commands.append((self._time, command))
        if len(self._commands) >= self._many:
            self._forget()

    def _forget(self) -> None:
        """Forget commands that are too old; half of the queue's next length are new."""
        commands = self._commands
        while len(commands) > 1 and commands[1][0] <= self._time - self._kept:
            commands.popleft()
        self._many = max(MANY, 2 * len(commands))

    def means(self, ago: float, parts: int, part: float) -> np.ndarray:
        """Return mean commands, (parts, count), in parts of `part` [s], from `ago` [s] before now on.

        What was not commanded is zero.
        """
        result, commands = np.zeros((parts, self._count)), self._commands
        if commands:
            begins = np.array([each[0] for each in commands])
            values = np.frombuffer(b"".join(each[1] for each in commands)).reshape(len(begins), -1)
            ends = np.append(begins[1:], self._time)
            low = self._time - ago + part * np.arange(parts)[:, None]
            overlap = np.minimum(ends, low + part) - np.maximum(begins, low)
            result = np.maximum(overlap, 0.0) @ values / part
        return result
