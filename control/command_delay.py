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
        begins: list[float] = []
        values: list[bytes] = []
        for begin, command in reversed(self._commands):
            begins.append(begin)
            values.append(command)
            if begin <= self._time - ago:  # those before are over
                break
        if not begins:
            return np.zeros((parts, self._count))
        low = self._time - ago + part * np.arange(parts)[:, None]
        overlap = np.minimum([self._time, *begins[:-1]], low + part) - np.maximum(begins, low)
        return np.maximum(overlap, 0.0) @ np.frombuffer(b"".join(values)).reshape(len(begins), -1) / part
