"""`Sensors` and their `Noise`: errors and delay."""

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from ..models.part import Part

DRAWN_AT_ONCE = 64  # periods whose noise is drawn together


class Noise(Part):
    """Errors of the sensors, as in a YAML file; each number is a standard deviation of white noise (default: 0).

    The bias of a run is drawn once, at its beginning.
    """

    position: float = Field(default=0.0, ge=0, le=1e3, description="of the platform's position [m]")
    attitude: float = Field(default=0.0, ge=0, le=10, description="of its roll, pitch and yaw [rad]")
    velocity: float = Field(default=0.0, ge=0, le=1e3, description="of its velocity [m/s]")
    attitude_rate: float = Field(default=0.0, ge=0, le=1e3, description="of the rates of roll, pitch and yaw [rad/s]")
    tension: float = Field(default=0.0, ge=0, le=1e9, description="of the tensions [N]")
    position_bias: float = Field(default=0.0, ge=0, le=1e3, description="of the bias of the position [m]")
    attitude_bias: float = Field(default=0.0, ge=0, le=10, description="of the bias of roll, pitch and yaw [rad]")
    tension_bias: float = Field(default=0.0, ge=0, le=1e9, description="of the bias of the tensions [N]")
    delay: float = Field(default=0.0, ge=0, le=10, description="of all sensors [s]; rounded to whole control periods")

    @property
    def of_motion(self) -> np.ndarray:
        """Return the standard deviations of pose [m, rad] and velocity, (12,)."""
        return np.repeat([self.position, self.attitude, self.velocity, self.attitude_rate], 3)

    @property
    def bias_of_motion(self) -> np.ndarray:
        """Return the standard deviations of the biases of pose [m, rad] and velocity, (12,)."""
        return np.repeat([self.position_bias, self.attitude_bias, 0.0, 0.0], 3)


class Sensors:
    """Sensors with noise, bias and delay, with separate random numbers for each run."""

    def __init__(self, noise: Noise, seeds: Sequence[int], period: float, m: int):
        self._noise, self._delay = noise, round(noise.delay / period)
        self._random = [np.random.default_rng([seed, 1]) for seed in seeds]
        self._of_motion, self._m = noise.of_motion, m
        self._exact = not (self._of_motion.any() or noise.bias_of_motion.any())
        self._exact_tensions = not (noise.tension or noise.tension_bias)
        draws = [random.normal(size=12 + m) for random in self._random]
        self._bias = np.array(draws)[:, None, :12] * noise.bias_of_motion
        self._tension_bias = np.array(draws)[:, 12:] * noise.tension_bias
        self._late: list[tuple[np.ndarray, np.ndarray]] = []

    def report(self, k: int, motions: np.ndarray, tensions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the sensor readings in period `k` for motions (N, 1 + c, 12) and tensions (N, m)."""
        if not (self._exact and self._exact_tensions):
            if k % DRAWN_AT_ONCE == 0:
                size = (DRAWN_AT_ONCE, 12 + self._m)
                self._drawn = np.stack([random.normal(size=size) for random in self._random], axis=1)
            drawn = self._drawn[k % DRAWN_AT_ONCE]
            motions = motions.copy()
            motions[:, :1] += self._bias + drawn[:, None, :12] * self._of_motion
            tensions = np.maximum(tensions + self._tension_bias + drawn[:, 12:] * self._noise.tension, 0.0)
        if self._delay:
            self._late.append((motions.copy(), tensions.copy()))
            motions, tensions = self._late[0] if len(self._late) <= self._delay else self._late.pop(0)
        return motions, tensions
