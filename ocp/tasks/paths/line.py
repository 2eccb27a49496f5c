"""`LinePath`: a straight line."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field
from typing_extensions import override

from .base import PathBase, PoseOrPosition
from .motion import Motion
from .rest_to_rest import rest_to_rest

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

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        start, change = np.array(self.start), np.array(self.end) - np.array(self.start)
        s = (times / duration)[:, None]
        if self.timing == "uniform":
            return Motion(start + s * change, np.ones_like(s) * change / duration, np.zeros_like(s) * change)
        done, rate, rate_rate = (part * change for part in rest_to_rest(s))
        return Motion(start + done, rate / duration, rate_rate / duration**2)
