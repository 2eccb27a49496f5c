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
        """Forget all commands, of `count` numbers each; `time` [s] has passed since."""
        self.time, self._count, self._many = 0.0, count, MANY
        self._commands: deque[tuple[float, bytes]] = deque()

    def wait(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self.time += dt

    def add(self, command: bytes) -> None:
        """Add a command from now on, the bytes of (count,) numbers."""
        self._commands.append((self.time, command))
        if len(self._commands) >= self._many:
            self._forget()

    def _forget(self) -> None:
        """Forget commands that are too old; half of the queue's next length are new."""
        commands = self._commands
        while len(commands) > 1 and commands[1][0] <= self.time - self._kept:
            commands.popleft()
        self._many = max(MANY, 2 * len(commands))

    def means(self, ago: float, parts: int, part: float) -> np.ndarray:
        """Return mean commands, (parts, count), in parts of `part` [s], from `ago` [s] before now on.

        What was not commanded is zero.
        """
        edges = self.time - ago + part * np.arange(parts + 1)
        first, last = float(edges[0]), float(edges[-1])
        begins: list[float] = []
        values: list[bytes] = []
        for begin, command in reversed(self._commands):
            if begin < last:
                begins.insert(0, begin)
                values.insert(0, command)
            if begin <= first:  # those before are over
                break
        if not begins:
            return np.zeros((parts, self._count))
        starts, commands = np.array(begins), np.frombuffer(b"".join(values)).reshape(len(begins), -1)
        # Integrals at the beginnings are added one after the other, since BLAS rounds those of a robot differently
        # depending on how many there are.
        integrals = np.zeros_like(commands)
        np.cumsum((starts[1:] - starts[:-1])[:, None] * commands[:-1], axis=0, out=integrals[1:])
        at = np.maximum(starts.searchsorted(edges, side="right") - 1, 0)
        reached = integrals[at] + np.maximum(edges - starts[at], 0.0)[:, None] * commands[at]
        return (reached[1:] - reached[:-1]) / part
