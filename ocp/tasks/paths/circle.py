"""`CirclePath`: a circle or a helix."""

from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import Field
from typing_extensions import override

from ....models.part import Direction, Finite, NonNegative, Vector3, optional
from .base import Motion, PathBase

ALONG_X = 1e-6  # the part of the x axis across the circle's axis has no reliable direction if it is shorter


class CirclePath(PathBase):
    """A circle at constant speed, horizontal unless it has another axis; with a drift of its centre, a helix."""

    kind: Literal["circle"]
    centre: Vector3 = Field(description="centre at the start [m]")
    radius: NonNegative = Field(description="radius [m]")
    rate: Finite = Field(description="angular velocity [rad/s]; positive: right-handed about the axis")
    axis: Direction = optional(
        "axis through the centre, of any length; (0, 1, 0) for a circle in front of a wall", (0.0, 0.0, 1.0)
    )
    phase: Finite = optional(
        "angle at the start, from the x axis projected on the circle's plane, or from the y axis if the axis of the "
        "circle is x [rad]",
        0.0,
    )
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

    @cached_property
    def _plane(self) -> np.ndarray:
        """Return the directions in the plane of the circle at angles of 0 and 90 degrees, (2, 3)."""
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        first = np.eye(3)[0] - axis[0] * axis
        if np.linalg.norm(first) < ALONG_X:
            first = np.eye(3)[1] - axis[1] * axis
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(axis, first)])

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        angle = self.phase + self.rate * times
        arm = self.radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1) @ self._plane
        turned = self.radius * np.stack([-np.sin(angle), np.cos(angle)], axis=-1) @ self._plane
        drift = np.array(self.drift)
        still = np.zeros((len(times), 3))
        attitude = np.tile(np.array(self.attitude), (len(times), 1))
        return Motion(
            np.hstack([np.array(self.centre) + arm + times[:, None] * drift, attitude]),
            np.hstack([self.rate * turned + drift, still]),
            np.hstack([-(self.rate**2) * arm, still]),
        )
