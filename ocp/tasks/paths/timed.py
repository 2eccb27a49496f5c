"""`TimedPath`: a path with a time law of its own."""

from functools import cached_property
from itertools import pairwise
from typing import Annotated, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator
from typing_extensions import override

from ....models.part import Finite, NonNegative, Positive, optional
from .base import PathBase, check_times
from .circle import CirclePath
from .line import LinePath
from .motion import Motion
from .rest import RestPath
from .samples import SamplePath
from .stations import Stations
from .time_law import SmoothedLaw, TimeLaw
from .waypoints import WaypointPath

Curve: TypeAlias = Annotated[RestPath | LinePath | CirclePath | WaypointPath | SamplePath, Field(discriminator="kind")]
"""A path of any kind but `timed`."""


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
