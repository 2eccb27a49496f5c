"""`Noise`: errors and delay of the sensors."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from ..models.part import Part


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
