"""`Noise`: errors, resolution, rate and delay of the sensors of a robot, as data."""

import numpy as np
from pydantic import Field

from ..models.part import Part


class Noise(Part):
    """Errors of the sensors, as in a YAML file; the default is perfect sensors.

    A number without another description is the standard deviation of white noise. The bias of a run is drawn once, at
    its beginning.
    """

    position: float = Field(default=0.0, ge=0, le=1e3, description="standard deviation of the platform's position [m]")
    attitude: float = Field(default=0.0, ge=0, le=10, description="standard deviation of roll, pitch and yaw [rad]")
    velocity: float = Field(default=0.0, ge=0, le=1e3, description="standard deviation of the velocity [m/s]")
    attitude_rate: float = Field(
        default=0.0, ge=0, le=1e3, description="standard deviation of the rates of roll, pitch and yaw [rad/s]"
    )
    tension: float = Field(default=0.0, ge=0, le=1e9, description="standard deviation of the tensions [N]")
    position_bias: float = Field(
        default=0.0, ge=0, le=1e3, description="standard deviation of the bias of the position [m]"
    )
    attitude_bias: float = Field(
        default=0.0, ge=0, le=10, description="standard deviation of the bias of roll, pitch and yaw [rad]"
    )
    tension_bias: float = Field(
        default=0.0, ge=0, le=1e9, description="standard deviation of the bias of the tensions [N]"
    )
    resolution: float = Field(default=0.0, ge=0, le=1e3, description="steps of the measured position [m]")
    attitude_resolution: float = Field(default=0.0, ge=0, le=10, description="steps of roll, pitch and yaw [rad]")
    tension_resolution: float = Field(default=0.0, ge=0, le=1e9, description="steps of the measured tensions [N]")
    differenced: bool = Field(default=False, description="true: velocities are differences of the measured poses")
    rate: float | None = Field(
        default=None,
        ge=0.1,
        le=1e6,
        description="rate of all sensors [1/s]; between readings the last one is held; default: each period",
    )
    delay: float = Field(
        default=0.0, ge=0, le=10, description="delay of all sensors [s]; rounded to whole control periods"
    )
    stamped: bool = Field(
        default=False, description="true: states have the time of their measurement, from which controllers predict"
    )

    @property
    def of_motion(self) -> np.ndarray:
        """Return the standard deviations of pose [m, rad] and velocity, (12,)."""
        return np.repeat([self.position, self.attitude, self.velocity, self.attitude_rate], 3)

    @property
    def bias_of_motion(self) -> np.ndarray:
        """Return the standard deviations of the biases of pose [m, rad] and velocity, (12,)."""
        return np.repeat([self.position_bias, self.attitude_bias, 0.0, 0.0], 3)
