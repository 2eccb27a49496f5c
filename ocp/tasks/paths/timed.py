"""`TimedPath`: a curve with a time law; `TimeLaw`: the motion along a curve, and its mean over a short time."""

from functools import cached_property
from itertools import pairwise
from typing import Annotated, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator
from typing_extensions import override

from ....models.part import Finite, NonNegative, Positive, optional
from .base import Motion, PathBase, Stations, check_times
from .circle import CirclePath
from .line import LinePath, RestPath
from .samples import SamplePath
from .waypoints import WaypointPath

SLOW = 1e-6  # of the largest speed: so slow is at rest
Curve: TypeAlias = Annotated[RestPath | LinePath | CirclePath | WaypointPath | SamplePath, Field(discriminator="kind")]
"""A path of any kind but `timed`."""


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


class TimedPath(PathBase):
    """A path with its own time law: d2s/dt2 is constant between the given points; at the end the path stops.

    It can dwell where ds/dt is zero.

    `time_along` creates such paths.
    """

    kind: Literal["timed"]
    along: Curve = Field(
        description="the path; s is the fraction of the path's own time, or of its length for straight legs"
    )
    until: Positive | None = optional(
        "time on the path's own clock at which it ends [s]; default: its natural duration"
    )
    s: tuple[Finite, ...] = Field(min_length=2, description="grid of s, increasing from 0 to 1")
    speeds: tuple[NonNegative, ...] = Field(min_length=2, description="ds/dt at each s [1/s]")
    dwell: tuple[NonNegative, ...] | None = optional(
        "duration of the stop at each s [s]; 0 wherever the speed is not 0; default: no stop"
    )
    smoothing: Positive | None = optional(
        "time over which the time law is averaged, so that the acceleration does not jump and is zero at "
        "rest [s]; the motion then has the duration of the task; default: no smoothing"
    )

    @model_validator(mode="after")
    def _law_fits(self) -> Self:
        if len(self.s) != len(self.speeds):
            raise ValueError(f"speeds must have one number for each of the {len(self.s)} s, got {len(self.speeds)}")
        if self.s[0] != 0 or self.s[-1] != 1:
            raise ValueError(f"s must go from 0 to 1, got {self.s[0]:g} to {self.s[-1]:g}")
        check_times(self.s, len(self.s), "s", "")
        for index, (before, after) in enumerate(pairwise(self.speeds)):
            if before == after == 0:
                raise ValueError(f"speeds must not be 0 twice in a row, got 0 at {index} and {index + 1}")
        if self.dwell is not None:
            if len(self.dwell) != len(self.s):
                raise ValueError(f"dwell must have one number for each of the {len(self.s)} s, got {len(self.dwell)}")
            for index, (seconds, speed) in enumerate(zip(self.dwell, self.speeds, strict=True)):
                if seconds > 0 and speed > 0:
                    raise ValueError(f"dwell[{index}] must be 0 s where the speed is not 0, got {seconds:g} s")
        if self.frame != self.along.frame:
            raise ValueError(f"frame must equal along.frame, {self.along.frame!r}, got {self.frame!r}")
        return self

    @cached_property
    def _law(self) -> TimeLaw | SmoothedLaw:
        law = TimeLaw(np.array(self.s), np.array(self.speeds), np.array(self.dwell or np.zeros(len(self.s))))
        return law if self.smoothing is None else SmoothedLaw(law, self.smoothing)

    @property
    def least(self) -> float:
        """Return how long the motion lasts with the speeds given [s]."""
        return self._law.duration

    @property
    def times(self) -> np.ndarray:
        """Return the time at which the path arrives at each s, (n,) [s]."""
        return self._law.times

    @property
    @override
    def natural_duration(self) -> float | None:
        return self.least if self.smoothing is None else None

    def resting_until(self, seconds: float) -> Self:
        """Return the path with a rest at its end if it would last less than `seconds`."""
        if self.least >= seconds:
            return self
        dwell = (*(self.dwell or [0.0] * len(self.s))[:-1], seconds - self.least + (self.dwell or (0.0,))[-1])
        return self.model_copy(update={"dwell": dwell})

    def law(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return s, ds/dt [1/s] and d2s/dt2 [1/s^2] at `times` [s], (n,) each."""
        return self._law.at(times)

    def time_at(self, s: np.ndarray) -> np.ndarray:
        """Return the time at which it arrives at s, (n,) [s]."""
        return self._law.time_at(s)

    @override
    def jumps(self) -> np.ndarray:
        return self._law.jumps()

    @override
    def stations(self, duration: float) -> Stations:
        if not isinstance(self.along, WaypointPath):
            return Stations()
        slower = self._slower(duration)
        return self.along.stations(1.0)._replace(times=slower * self.time_at(self.along.places))

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        slower = self._slower(duration)
        s, sd, sdd = self.law(np.asarray(times) / slower)
        return self.along.by_fraction(s, self.until).timed(sd / slower, sdd / slower**2)

    def _slower(self, duration: float) -> float:
        """Return how many times as long as with the speeds given the motion lasts in a task of `duration` [s]."""
        return 1.0 if self.smoothing is None else duration / self.least
