"""`TensionLoop`: correct the commands to winches until sensors report the desired tensions."""

import numpy as np

from .lag import SHORTEST


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
