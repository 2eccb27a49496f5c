"""First-order lags: `Lag`, how drives follow commands, and `RotorLead`, commands that make up for a known one."""

from typing import Any

import numpy as np

from ..models.robot import Robot

SHORTEST = 1e-9  # [s], which divides
LEFT = 0.015  # [s]: what a lead leaves of a lag


class Lag:
    """Let drives follow commands with time constants: lag dy/dt = u - y.

    Parameters
    ----------
    lag
        Time constants [s], which broadcast with commands.
    """

    def __init__(self, lag: Any):
        self._lag = np.maximum(lag, SHORTEST)
        self.value: Any = None  # y

    def follow(self, command: np.ndarray, dt: float) -> np.ndarray:
        """Return the mean of y while a command is held for `dt` [s]; `value` is y then, and first the command."""
        left = np.exp(-dt / self._lag)
        missing = 0 * command if self.value is None else self.value - command
        self.value = command + missing * left
        return command + missing * self._lag / dt * (1 - left)


class RotorLead:
    """Send actuators of flying carriers more than they should give, so that they follow a known lag earlier.

        u = y + (lag / left) (wanted - y)

    with y, what the actuators give by now if their lag is as known.

    Parameters
    ----------
    robot
        The robot.
    lag
        Time constant of the actuators [s].
    """

    def __init__(self, robot: Robot, lag: float):
        self._ratio, most = max(lag / LEFT, 1.0), max(len(carrier.actuators) for carrier in robot.carriers)
        self._lag, self._limits = lag, np.zeros((2, len(robot.carriers), most))  # (2, c, a)
        for index, carrier in enumerate(robot.carriers):
            for number, each in enumerate(carrier.actuators):
                self._limits[:, index, number] = each.low, each.high
        self.reset()

    def reset(self) -> None:
        """Forget all earlier steps."""
        self._given, self._sent = Lag(self._lag), np.zeros(0)

    def pass_time(self, dt: float, actuation: np.ndarray) -> None:
        """Write what the actuators gave on average since the last step, `dt` [s] ago, to `actuation`, (N, c, a)."""
        if dt > 0 and self._given.value is not None:
            actuation[:] = self._given.follow(self._sent, dt)

    def sent(self, wanted: np.ndarray) -> np.ndarray:
        """Return the commands, (N, c, a), from what actuators should give."""
        given = self._given.value = wanted.copy() if self._given.value is None else self._given.value
        self._sent = np.clip(given + self._ratio * (wanted - given), *self._limits)
        return self._sent.copy()

    def agree(self, other: "RotorLead") -> None:
        """Take over what another one has sent."""
        self._given.value, self._sent = other._given.value, other._sent
