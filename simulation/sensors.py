"""`Sensors`: readings with the errors, resolution, rate and delay of a `Noise`."""

from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

import numpy as np

from ..control.noise import Noise
from ..models.points import shortest_way

DRAWN_AT_ONCE = 64  # periods whose noise is drawn together
EARLY = 1e-6  # of a sample
_WHEN = {"delay", "rate", "stamped"}  # what does not change the readings


class Reading(NamedTuple):
    """The readings of all sensors in one period."""

    motions: np.ndarray  # (N, 1 + c, 12)
    tensions: np.ndarray  # (N, m) [N]
    time: float | None  # of the measurement [s], if it is known


class Sensors:
    """Sensors with noise, bias, resolution, rate and delay, with separate random numbers for each run."""

    def __init__(self, noise: Noise, seeds: Sequence[int], period: float, m: int):
        self._noise, self._period, self._m = noise, period, m
        self._delay = ceil(noise.delay / period - EARLY)
        self._exact = not noise.model_dump(exclude=_WHEN, exclude_defaults=True)
        self._random = [np.random.default_rng([seed, 1]) for seed in seeds]
        draws = [random.normal(size=12 + m) for random in self._random]
        self._bias = np.array(draws)[:, :12] * noise.bias_of_motion
        self._tension_bias = np.array(draws)[:, 12:] * noise.tension_bias
        self._of_motion, self._drawn, self._block = noise.of_motion, np.empty(0), -1
        self._steps = np.repeat([noise.resolution, noise.attitude_resolution], 3)
        self._last: Reading | None = None
        self._sampled = -1
        self._late: list[Reading] = []

    def report(self, k: int, motions: np.ndarray, tensions: np.ndarray) -> Reading:
        """Return the readings in period `k` for motions (N, 1 + c, 12) and tensions (N, m)."""
        reading = self._last
        if reading is None or self._samples(k):
            reading = Reading(motions, tensions, k * self._period if self._noise.stamped else None)
            if not self._exact:
                reading = self._measured(k, reading)
            if self._delay or self._noise.rate or self._noise.differenced:
                reading = reading._replace(motions=reading.motions.copy(), tensions=reading.tensions.copy())
                self._last, self._sampled = reading, k
        if self._delay:
            self._late.append(reading)
            return self._late[0] if len(self._late) <= self._delay else self._late.pop(0)
        return reading

    def _samples(self, k: int) -> bool:
        """Return whether the sensors measure in period `k`."""
        if self._noise.rate is None:
            return True
        per = self._noise.rate * self._period  # samples
        return int(k * per + EARLY) > int((k - 1) * per + EARLY)

    def _measured(self, k: int, true: Reading) -> Reading:
        """Return what is measured in period `k`."""
        noise, block = self._noise, k // DRAWN_AT_ONCE
        if block != self._block:
            size = (DRAWN_AT_ONCE, 12 + self._m)
            self._drawn = np.stack([random.normal(size=size) for random in self._random], axis=1)
            self._block = block
        drawn = self._drawn[k % DRAWN_AT_ONCE]
        motions = true.motions.copy()
        platform = motions[:, 0]
        platform += self._bias + drawn[:, :12] * self._of_motion
        platform[:, :6] = _rounded(platform[:, :6], self._steps)
        if noise.differenced and self._last is not None:
            moved = shortest_way(platform[:, :6] - self._last.motions[:, 0, :6])
            platform[:, 6:] = moved / ((k - self._sampled) * self._period)
        tensions = np.maximum(true.tensions + self._tension_bias + drawn[:, 12:] * noise.tension, 0.0)
        return true._replace(motions=motions, tensions=_rounded(tensions, np.array(noise.tension_resolution)))


def _rounded(values: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return values as whole numbers of steps; steps of zero change nothing."""
    if not steps.any():
        return values
    return np.where(steps > 0, np.round(values / np.where(steps > 0, steps, 1.0)) * steps, values)
