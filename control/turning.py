"""`Turning`: whether flying carriers turn as late as makes their attitude loop unstable, and how late."""

from __future__ import annotations

import numpy as np

LATE = 1.5  # over the bandwidth: a lag of 2 is where the loop gets unstable
WINDOW = 0.05  # [s], in which orders and rates are compared
FASTEST = 1e4  # [rad/s]: nothing turns faster
SEEN = 0.01  # [rad]: what the lag makes of a carrier's attitude until it is believed


class Turning:
    """Measure how late carriers turn after the angular accelerations that were ordered.

    With rotors that follow their commands with a lag tau, a critically damped attitude loop of bandwidth h,

        tau phi''' + phi'' + 2 h phi' + h^2 phi = 0,

    is stable for h tau < 2 (Routh). Rates r without what they were long ago, and the integrals x of ordered
    accelerations without the same, obey tau dr/dt = x - r. A delay of D counts as D at most. So

        tau = <x - r, dr/dt> / <dr/dt, dr/dt>

    of all carriers and axes of a robot, where a lag of 1 / h before gives derivatives, and keeps vibrations away.

    Parameters
    ----------
    bandwidth
        h of the attitude loop [rad/s].
    """

    def __init__(self, bandwidth: float):
        self._bandwidth, self._late = bandwidth, LATE / bandwidth
        self._least = (SEEN * WINDOW * bandwidth**2 / self._late) ** 2  # mean square of dr/dt
        self.reset()

    def reset(self) -> None:
        """Forget all earlier steps."""
        self._before: np.ndarray | None = None

    def lag(self, dt: float, ordered: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return the lag of carriers that are too late, `dt` [s] after the last step, else 0, (N,) [s].

        Parameters
        ----------
        ordered
            Angular accelerations since that step in the carriers' axes, (N, c, 3) [rad/s^2]; nan where actuators were
            at their limits, which starts the comparison of that carrier again, as rates do that are no numbers.
        rates
            Measured now, (N, c, 3) [rad/s].
        """
        rates = np.where(np.abs(rates) <= FASTEST, rates, np.nan)
        if self._before is None or dt > WINDOW:
            self._before, self._motions = rates.copy(), np.zeros((3, *rates.shape))
            self._along, self._square = np.zeros((2, len(rates)))
            return np.zeros(len(rates))
        exact, x, r = self._motions
        share, slow = 1.0 - np.exp(-self._bandwidth * dt), dt / WINDOW
        exact += dt * ordered - slow * exact
        self._before += slow * (rates - self._before)
        change = rates - self._before - r
        x += share * (exact - x)
        r += share * change
        again = ~np.isfinite(x + r)
        if again.any():
            self._motions[:, again], self._before[again], change[again] = 0.0, rates[again], 0.0
        change *= self._bandwidth  # dr/dt
        self._along += slow * (((x - r) * change).sum(axis=(1, 2)) - self._along)
        self._square += slow * ((change * change).sum(axis=(1, 2)) - self._square)
        late = (self._along > self._late * self._square) & (self._square > self._least)
        return np.where(late, self._along / np.maximum(self._square, self._least), 0.0)
