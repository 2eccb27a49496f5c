"""`LinePath`: a straight line."""

from typing import Literal

import numpy as np
from pydantic import Field
from typing_extensions import override

from ....models.part import optional
from .base import PathBase, PoseOrPosition
from .motion import Motion
from .rest_to_rest import rest_to_rest, smoother_rest_to_rest


class LinePath(PathBase):
    """A straight line from one pose to another, over the task's duration."""

    kind: Literal["line"]
    start: PoseOrPosition = Field(description="first pose, (x, y, z) or (x, y, z, roll, pitch, yaw) [m, rad]")
    end: PoseOrPosition = Field(description="last pose, (x, y, z) or (x, y, z, roll, pitch, yaw) [m, rad]")
    timing: Literal["smooth", "smoother", "uniform"] | None = optional(
        "smooth: from rest to rest, acceleration and jerk zero there; smoother: the next two derivatives "
        "zero too; uniform: constant speed; default: smoother if quadrotors could otherwise not rest at the ends "
        "(an exact path of a platform on fewer than six cables), else smooth"
    )

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        start, change = np.array(self.start), np.array(self.end) - np.array(self.start)
        s = (times / duration)[:, None]
        if self.timing == "uniform":
            return Motion(start + s * change, np.ones_like(s) * change / duration, np.zeros_like(s) * change)
        law = smoother_rest_to_rest if self.timing == "smoother" else rest_to_rest
        done, rate, rate_rate = (part * change for part in law(s))
        return Motion(start + done, rate / duration, rate_rate / duration**2)
