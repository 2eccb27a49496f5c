"""`Drives`: what winches, rotors and carriers make of commands, with their lag, gain and friction."""

from collections.abc import Sequence

import numpy as np

from ..control.lag import Lag
from ..models.points import shortest_way
from ..models.trajectory import moved_on
from .mismatch import LAGS, TENSIONS, Drawn

SLOW = 0.01  # [m/s] of a cable: slower, dry friction is less, without which it would chatter at rest
SHORTEST = 1e-3  # of a period: of lags, which divide


class Drives:
    """Turn commands into what the drives of N runs make of them.

    - `drawn`: numbers of each run.
    - `period`: period of the commands [s].
    """

    def __init__(self, drawn: Sequence[Drawn], period: float):
        self._period = period
        self._gain, self._friction = (np.array([getattr(one, name) for one in drawn]) for name in TENSIONS)
        lags = [np.array([getattr(one, name) for one in drawn]) for name in LAGS]
        self._winches, self._rotors = (Lag(lag) if lag.any() else None for lag in (lags[0], lags[1][..., None]))
        self._carriers = np.maximum(lags[2], SHORTEST * period)[..., None] if lags[2].any() else None  # (N, c, 1)
        self._poses: np.ndarray | None = None  # of the carriers, (N, c, 6)

    def tensions(self, command: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return the tensions that winches give in a period, (N, m) [N], for the rates of cable lengths then."""
        given = self._gain * np.asarray(command, dtype=float)
        given = given if self._winches is None else self._winches.follow(given, self._period)
        return np.maximum(given + self._friction * np.tanh(rates / SLOW), 0.0)

    def lengths(self, command: np.ndarray) -> np.ndarray:
        """Return the unstrained lengths that winches have reached at the end of a period, (N, m) [m]."""
        if self._winches is None:
            return command
        self._winches.follow(np.broadcast_to(command, self._gain.shape), self._period)
        return self._winches.value

    def actuation(self, command: np.ndarray) -> np.ndarray:
        """Return what actuators give on average in a period, (N, c, a)."""
        if self._rotors is None:
            return command
        return self._rotors.follow(command.reshape(len(self._gain), *command.shape[-2:]), self._period)

    def follow(self, starts: np.ndarray, ends: np.ndarray) -> None:
        """Replace the motion that carriers should have as a period begins and ends, (N, c, 3, 6) each, by their own.

        What a carrier is behind, e, obeys tau de/dt = tau v - e with the velocity v that it should have. It begins
        where it should be.
        """
        if self._carriers is None:
            return
        tau, period = self._carriers, self._period
        at = starts[:, :, 0]
        behind = np.zeros_like(at) if self._poses is None else shortest_way(at - self._poses)
        after = moved_on((at, starts[:, :, 1], starts[:, :, 2]), period)
        steady = tau * (starts[:, :, 1] - tau * starts[:, :, 2])
        late = tau * (after[1] - tau * starts[:, :, 2]) + (behind - steady) * np.exp(-period / tau)
        for motion, e in ((starts, behind), (ends, late)):
            motion[:, :, 0] -= e
            motion[:, :, 2] = (motion[:, :, 1] - e / tau) / tau
            motion[:, :, 1] = e / tau
        self._poses = ends[:, :, 0].copy()
