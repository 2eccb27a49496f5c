"""`LinePath`: a straight line."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field
from typing_extensions import override

from .base import PathBase, PoseOrPosition
from .motion import Motion

__all__ = ["LinePath"]


class LinePath(PathBase):
    """A straight line from one pose to another, over the task's duration."""

    kind: Literal["line"]
    start: PoseOrPosition = Field(description="(x, y, z) or (x, y, z, roll, pitch, yaw) [m, rad]")
    end: PoseOrPosition = Field(description="(x, y, z) or (x, y, z, roll, pitch, yaw) [m, rad]")
    timing: Literal["smooth", "uniform"] = Field(
        default="smooth",
        description="smooth: from rest to rest, acceleration and jerk zero there; uniform: constant speed",
    )

    @property
    @override
    def stretches(self) -> bool:
        return True

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        start, change = np.array(self.start), np.array(self.end) - np.array(self.start)
        s = (times / duration)[:, None]
        if self.timing == "uniform":
            return Motion(start + s * change, np.ones_like(s) * change / duration, np.zeros_like(s) * change)
        # Acceleration and jerk are zero at both ends: carriers take places that follow the platform's acceleration, so
        # only then can they start and end at rest too.
        done = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
        rate = 140 * s**3 * (1 - s) ** 3 / duration
        rate_rate = 420 * s**2 * (1 - s) ** 2 * (1 - 2 * s) / duration**2
        return Motion(start + done * change, rate * change, rate_rate * change)
