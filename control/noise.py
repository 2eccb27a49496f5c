"""`Noise`: errors, resolution, rate and delay of the sensors of a robot, as data."""

import numpy as np

from ..models.part import Part, optional


class Noise(Part):
    """Errors of the sensors, as in a YAML file; the default is perfect sensors.

    A number without another description is the standard deviation of white noise. The bias of a run is drawn once, at
    its beginning.
    """

    position: float = optional("standard deviation of the platform's position [m]", 0.0, ge=0, le=1e3)
    attitude: float = optional("standard deviation of roll, pitch and yaw [rad]", 0.0, ge=0, le=10)
    velocity: float = optional("standard deviation of the velocity [m/s]", 0.0, ge=0, le=1e3)
    attitude_rate: float = optional("standard deviation of the rates of roll, pitch and yaw [rad/s]", 0.0, ge=0, le=1e3)
    tension: float = optional("standard deviation of the tensions [N]", 0.0, ge=0, le=1e9)
    position_bias: float = optional("standard deviation of the bias of the position [m]", 0.0, ge=0, le=1e3)
    attitude_bias: float = optional("standard deviation of the bias of roll, pitch and yaw [rad]", 0.0, ge=0, le=10)
    tension_bias: float = optional("standard deviation of the bias of the tensions [N]", 0.0, ge=0, le=1e9)
    resolution: float = optional("steps of the measured position [m]", 0.0, ge=0, le=1e3)
    attitude_resolution: float = optional("steps of roll, pitch and yaw [rad]", 0.0, ge=0, le=10)
    tension_resolution: float = optional("steps of the measured tensions [N]", 0.0, ge=0, le=1e9)
    differenced: bool = optional("true: velocities are differences of the measured poses", False)
    rate: float | None = optional(
        "rate of all sensors [1/s]; between readings the last one is held; default: each period", ge=0.1, le=1e6
    )
    delay: float = optional("delay of all sensors [s]; readings count from the next period on", 0.0, ge=0, le=10)
    stamped: bool = optional("true: states have the time of their measurement, from which controllers predict", False)

    @property
    def of_motion(self) -> np.ndarray:
        """Return the standard deviations of pose [m, rad] and velocity, (12,)."""
        return np.repeat([self.position, self.attitude, self.velocity, self.attitude_rate], 3)

    @property
    def of_pose(self) -> np.ndarray:
        """Return the standard deviations of positions [m] and angles [rad], including resolutions, (2,)."""
        steps = np.array([self.resolution, self.attitude_resolution]) / np.sqrt(12)
        return np.hypot(np.array([self.position, self.attitude]), steps)

    @property
    def of_tensions(self) -> float:
        """Return the standard deviation of tensions [N], including their resolution."""
        return float(np.hypot(self.tension, self.tension_resolution / np.sqrt(12)))

    @property
    def bias_of_motion(self) -> np.ndarray:
        """Return the standard deviations of the biases of pose [m, rad] and velocity, (12,)."""
        return np.repeat([self.position_bias, self.attitude_bias, 0.0, 0.0], 3)
