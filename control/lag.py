"""First-order lags: `Lag`, how drives follow commands, and `Lead`, commands that make up for a known one.

`tension_lead` is the lead of a robot's tensions, `RotorLead` that of the actuators of its flying carriers.
"""

from typing import Any

import numpy as np
from typing_extensions import override

from ..models.part import inertia_matrix
from ..models.robot import Robot
from .settings import Limits

SHORTEST = 1e-9  # [s], which divides
WINCHES_KEEP, ROTORS_KEEP = 0.005, 0.015  # [s]: what leads leave of their lags


class TensionLoop:
    """Add the integral of the tension error to the desired tensions, for winches that deliver others.

        u = t + i,   di/dt = k (late t - t_measured)

    with t delayed like the winches. A command stays inside limits and rates, at which the integral stops.

    - `bandwidth`: k [rad/s].
    - `lag`: time constant with which winches follow their commands [s]; 0 if `before` is what they gave.
    - `lowest`, `highest`, `fastest`: limits of commands, (m,) [N], and of their rates [N/s].
    """

    def __init__(self, bandwidth: float, lag: float, lowest: np.ndarray, highest: np.ndarray, fastest: np.ndarray):
        self._bandwidth, self._lag, self._fastest = bandwidth, lag, fastest
        self._lowest, self._highest = lowest, highest
        self.reset()

    def reset(self) -> None:
        """Forget all earlier steps."""
        self._sent: np.ndarray | None = None

    def sent(
        self, dt: float, wanted: np.ndarray, before: np.ndarray, measured: np.ndarray | None, cut: np.ndarray
    ) -> np.ndarray:
        """Return the tensions to send, (N, m) [N].

        - `dt`: time since the last step [s].
        - `wanted`: desired tensions from now on, (N, m) [N].
        - `before`, `measured`: desired tensions at the time of the measurement, (N, m) [N], and the measured ones; nan
          and None change nothing.
        - `cut`: cables that are treated as cut, (N, m): their commands are the desired tensions.
        """
        if self._sent is None:
            self._late = self._sent = wanted.copy()
            self._more = np.zeros_like(wanted)
        self._late = self._late + (1.0 - np.exp(-dt / max(self._lag, SHORTEST))) * (before - self._late)
        if measured is not None:
            lacking = np.where(np.isfinite(measured), self._late - measured, 0.0)
            self._more = self._more + min(self._bandwidth * dt, 1.0) * lacking
        room = self._fastest * dt if dt > 0 else np.inf
        sent = np.clip(wanted + self._more, self._sent - room, self._sent + room)
        sent = np.where(cut, wanted, np.clip(sent, self._lowest, self._highest))
        self._more, self._sent = sent - wanted, sent
        return sent.copy()


class Lag:
    """Let drives follow commands with time constants: lag dy/dt = u - y.

    `lag`: time constants [s], which broadcast with commands.
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


class Lead:
    """Send drives more than they should give, so that they follow a known lag earlier.

        u = y + (lag / left) (wanted - y)

    with y, what the drives give by now if their lag is as known.

    - `lag`: time constant of the drives [s].
    - `left`: remaining time constant [s]; a shorter lag is not changed.
    - `low`, `high`: limits of commands, which broadcast with them.
    - `rate`: largest rate of change of commands, likewise.
    """

    def __init__(self, lag: float, left: float, low: np.ndarray, high: np.ndarray, rate: Any = np.inf):
        self._ratio, self._lag, self._limits, self._rate = max(lag / left, 1.0), lag, (low, high), rate
        self.reset()

    def amplify(self, most: float, longest: float) -> None:
        """Multiply noise of what the drives should give by `most`, from 1 on, at most, and leave more of the lag.

        If more than `longest` [s] were left, the noise is multiplied by more than that.
        """
        self._ratio = min(self._ratio, max(most, self._lag / max(longest, SHORTEST)))

    def reset(self) -> None:
        """Forget all earlier steps."""
        self._given, self._sent = Lag(self._lag), np.zeros(0)

    def pass_time(self, dt: float, given: np.ndarray) -> None:
        """Write what the drives gave on average since the last step, `dt` [s] ago, to `given`, (N, ...)."""
        if dt > 0 and self._given.value is not None:
            given[:] = self._given.follow(self._sent, dt)

    def sent(self, wanted: np.ndarray, dt: float = 0.0) -> np.ndarray:
        """Return the commands, (N, ...), from what drives should give; `dt` [s] is the time since the last ones."""
        if self._given.value is None:
            self._given.value = self._sent = wanted.copy()
        given, room = self._given.value, self._rate * dt if dt > 0 else np.inf
        sent = np.clip(given + self._ratio * (wanted - given), self._sent - room, self._sent + room)
        self._sent = np.clip(sent, *self._limits)
        return self._sent.copy()

    def agree(self, other: "Lead") -> None:
        """Take over what another one has sent."""
        self._given.value, self._sent = other._given.value, other._sent


def tension_lead(robot: Robot, limits: Limits, winches: float, rotors: float) -> Lead | None:
    """Return the lead of commands to winches that lag [s], None if their lag is negligible.

    Cables of fixed length have no winches. Their tensions lag as thrusts do in spite of the lead of the `rotors` [s],
    and no command is sent that could be ahead.
    """
    if robot.fixed_lengths is None:
        return Lead(winches, WINCHES_KEEP, *limits) if winches > WINCHES_KEEP else None
    remaining = min(rotors, ROTORS_KEEP)
    return Lead(remaining, ROTORS_KEEP, *limits) if remaining else None


class RotorLead(Lead):
    """Lead of the actuators of flying carriers, (N, c, a), for a known lag [s].

    Commands at their limits cannot make up for the lag. What this takes from the angular accelerations that carriers
    are ordered is known, so that it is not taken for a longer lag (core/control/turning.c).
    """

    def __init__(self, robot: Robot, lag: float):
        shape = len(robot.carriers), max(len(carrier.actuators) for carrier in robot.carriers)
        limits, self._turning = np.zeros((2, *shape)), np.zeros((*shape, 3))  # accelerations by unit commands
        for index, carrier in enumerate(robot.carriers):
            for number, each in enumerate(carrier.actuators):
                limits[:, index, number] = each.low, each.high
                if carrier.body is not None:
                    moment = np.array(each.wrench[3:])
                    self._turning[index, number] = np.linalg.solve(inertia_matrix(carrier.body.inertia), moment)
        super().__init__(lag, ROTORS_KEEP, *limits)

    @override
    def reset(self) -> None:
        super().reset()
        self._lost: Any = 0.0  # [rad/s^2]

    def turn(self, dt: float, given: np.ndarray, ordered: np.ndarray) -> None:
        """Write what the drives gave, as `pass_time` does, and what could be ordered last to `ordered`, (N, c, 3)."""
        self.pass_time(dt, given)
        ordered += self._lost

    @override
    def sent(self, wanted: np.ndarray, dt: float = 0.0) -> np.ndarray:
        sent, given = super().sent(wanted, dt), self._given.value
        lacks = given + (sent - given) / self._ratio - wanted
        self._lost = np.einsum("...ca,cak->...ck", lacks, self._turning)
        return sent

    @override
    def agree(self, other: "Lead") -> None:
        super().agree(other)
        self._lost = other._lost if isinstance(other, RotorLead) else 0.0
