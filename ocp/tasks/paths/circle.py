"""`CirclePath`: a circle or a helix."""

from typing import Literal

import numpy as np
from pydantic import Field
from typing_extensions import override

from ....models.part import Finite, NonNegative, Vector3, optional
from .base import PathBase
from .motion import Motion


class CirclePath(PathBase):
    """A circle about the vertical at constant speed, with an optional drift of its centre: a helix."""

    kind: Literal["circle"]
    centre: Vector3 = Field(description="centre at the start [m]")
    radius: NonNegative = Field(description="radius [m]")
    rate: Finite = Field(description="angular velocity [rad/s]; positive: counter-clockwise from above")
    phase: Finite = optional("angle at the start, from the x axis [rad]", 0.0)
    drift: Vector3 = optional("velocity of the centre [m/s]", (0.0, 0.0, 0.0))
    attitude: Vector3 = optional("constant attitude (roll, pitch, yaw) [rad]", (0.0, 0.0, 0.0))

    @property
    @override
    def natural_duration(self) -> float | None:
        return 2 * np.pi / abs(self.rate) if self.rate else None

    @property
    @override
    def stretches(self) -> bool:
        return False  # speed and drift are its own, even where it has no round

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        angle = self.phase + self.rate * times
        zero = np.zeros_like(times)
        arm = self.radius * np.stack([np.cos(angle), np.sin(angle), zero], axis=-1)
        turned = self.radius * np.stack([-np.sin(angle), np.cos(angle), zero], axis=-1)
        drift = np.array(self.drift)
        still = np.zeros((len(times), 3))
        attitude = np.tile(np.array(self.attitude), (len(times), 1))
        return Motion(
            np.hstack([np.array(self.centre) + arm + times[:, None] * drift, attitude]),
            np.hstack([self.rate * turned + drift, still]),
            np.hstack([-(self.rate**2) * arm, still]),
        )
