"""`SmoothedLaw`: the mean of a time law over a short time, which has no jumps of d2s/dt2."""

import numpy as np

from .time_law import TimeLaw

SLOW = 1e-6  # of the largest speed: so slow is at rest


class SmoothedLaw:
    """The mean of a law over the last `window`: it starts, stops and ends without acceleration.

    Where the law rests it waits for as long, so that the mean rests there too.

    - `law`: the law.
    - `window`: time over which the mean is taken [s].
    """

    def __init__(self, law: TimeLaw, window: float):
        dwell = law.dwell + window * (law.speeds == 0)
        dwell[[0, -1]] -= window
        self._law, self._window = TimeLaw(law.s, law.speeds, dwell), window
        knots = self._law.jumps()
        s, middle = self._law.at(knots)[0], self._law.at((knots[1:] + knots[:-1]) / 2)[0]
        # Simpson's rule is exact for polynomials of degree 2.
        self._knots, self._sums = knots, np.append(0.0, np.cumsum(np.diff(knots) * (s[:-1] + 4 * middle + s[1:]) / 6))

    @property
    def times(self) -> np.ndarray:
        """Return the time at which it arrives at each s of the law, (n,) [s]."""
        return self.time_at(self._law.s)

    @property
    def duration(self) -> float:
        """Return the time at which it ends [s]."""
        return self._law.duration + self._window

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return s, ds/dt and d2s/dt2 at `times` [s], (n,) each."""
        now, before = self._integrals(times), self._integrals(np.asarray(times) - self._window)
        s, speed, rate = ((a - b) / self._window for a, b in zip(now, before, strict=True))
        return s.clip(0.0, 1.0), speed, rate

    def time_at(self, s: np.ndarray) -> np.ndarray:
        """Return the time at which it arrives at s, (n,) [s]: exactly where it rests, else within half the window."""
        rests = np.interp(s, self._law.s, self._law.speeds) < SLOW * self._law.speeds.max()
        return self._law.time_at(s) + self._window * np.where(rests, np.asarray(s) > 0, 0.5)

    def jumps(self) -> np.ndarray:
        """Return the times at which d2s/dt2 may change at once: none."""
        return np.zeros(0)

    def _integrals(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the integral of s, s and ds/dt at `times` [s]; before the start and after the end the law rests."""
        knots = self._knots
        inside = np.clip(times, 0.0, knots[-1])
        k = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, len(knots) - 2)
        first, middle = (self._law.at(at)[0] for at in (knots[k], (knots[k] + inside) / 2))
        s, speed, _ = self._law.at(inside)
        sums = self._sums[k] + (inside - knots[k]) * (first + 4 * middle + s) / 6
        return sums + np.maximum(times - knots[-1], 0.0), s, np.where(times == inside, speed, 0.0)
