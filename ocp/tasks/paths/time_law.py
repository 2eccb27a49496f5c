"""`TimeLaw`: the motion along a curve; `SmoothedLaw`: its mean over a short time, which has no jumps of d2s/dt2."""

from functools import cached_property

import numpy as np

SLOW = 1e-6  # of the largest speed: so slow is at rest


class TimeLaw:
    """A motion s(t): d2s/dt2 is constant between the given points; where ds/dt is zero it can dwell.

    - `s`: increasing, (n,), of any unit.
    - `speeds`: ds/dt there, (n,), never zero at two neighbours.
    - `dwell`: how long it stops at each s, (n,) [s].
    """

    def __init__(self, s: np.ndarray, speeds: np.ndarray, dwell: np.ndarray):
        self.s, self.speeds, self.dwell = s, speeds, dwell
        self.rates = (speeds[1:] ** 2 - speeds[:-1] ** 2) / (2 * np.diff(s))  # d2s/dt2 between two points

    @cached_property
    def times(self) -> np.ndarray:
        """Return the time at which it arrives at each s, (n,) [s]."""
        steps = 2 * np.diff(self.s) / (self.speeds[1:] + self.speeds[:-1])
        return np.append(0.0, np.cumsum(steps + self.dwell[:-1]))

    @property
    def duration(self) -> float:
        """Return the time at which it ends [s]."""
        return float(self.times[-1] + self.dwell[-1])

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return s, ds/dt and d2s/dt2 at `times` [s], (n,) each."""
        knots, s, speeds = self.times, self.s, self.speeds
        k = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
        rate = self.rates[k]
        since = np.minimum(times, knots[-1]) - knots[k] - self.dwell[k]
        # The last instant belongs to the motion, as the first does: d2s/dt2 counts there too.
        still = (times > knots[-1] * (1 + 1e-12)) | (since < 0)
        at = s[k] + np.maximum(since, 0.0) * (speeds[k] + since * rate / 2)
        # Where the path turns at once, the acceleration before the place must not be taken along what comes after it.
        end = np.where(times < knots[k + 1], np.nextafter(s[k + 1], 0.0), s[k + 1])
        return np.minimum(at, end), np.where(still, 0.0, speeds[k] + since * rate), np.where(still, 0.0, rate)

    def time_at(self, s: np.ndarray) -> np.ndarray:
        """Return the time at which it arrives at s, (n,) [s]."""
        k = np.clip(np.searchsorted(self.s, s, side="left") - 1, 0, len(self.s) - 2)
        moved = s - self.s[k]
        mean = (self.speeds[k] + np.sqrt(np.maximum(self.speeds[k] ** 2 + 2 * self.rates[k] * moved, 0.0))) / 2
        since = np.divide(moved, mean, out=np.zeros_like(mean), where=mean > 0)
        return self.times[k] + self.dwell[k] * (since > 0) + since

    def jumps(self) -> np.ndarray:
        """Return the times at which d2s/dt2 may change at once, (n,) [s]."""
        return np.unique(np.concatenate([self.times, self.times + self.dwell]))


class SmoothedLaw:
    """The mean of a law over the last `window`: it starts, stops and ends without acceleration.

    It waits for this time wherever the law rests, so that the mean rests there too.

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
