"""`LinePath`: a straight line; `RestPath`: a pose that is held; and the laws of a motion from rest to rest.

Acceleration and jerk are zero at both ends: where carriers must be depends on the platform's acceleration, so they can
start and end at rest only if its acceleration and jerk are zero there. The smoother law is zero up to the fifth
derivative: where fewer than six cables hold a platform on an exact path, its acceleration determines the directions of
the cables, hence the positions of the quadrotors; and these rest only if their jerk, which turns their thrust, is zero.
"""

from typing import Literal

import numpy as np
from pydantic import Field
from typing_extensions import override

from ....models.part import optional
from .base import Motion, PathBase, PoseOrPosition

SMOOTHER_PEAK = 13860 * (2 / 9) ** 4 / 3  # of the second derivative of the smoother law, at s = 1/3


def rest_to_rest(s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the share of the way and its first two derivatives, at the shares s of the time; before and after: rest.

    With s from 0 to 1, phi(s) = s^4 (35 - 84 s + 70 s^2 - 20 s^3), and phi(1 - s) = 1 - phi(s).
    """
    s = np.clip(s, 0.0, 1.0)
    left = 1 - s
    done = s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)
    return done, 140 * (s * left) ** 3, 420 * (s * left) ** 2 * (1 - 2 * s)


def smoother_rest_to_rest(s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what `rest_to_rest` does, by the law of degree 11 with five derivatives that are zero at both ends."""
    s = np.clip(s, 0.0, 1.0)
    left = 1 - s
    done = s**6 * (462 - 1980 * s + 3465 * s**2 - 3080 * s**3 + 1386 * s**4 - 252 * s**5)
    return done, 2772 * (s * left) ** 5, 13860 * (s * left) ** 4 * (1 - 2 * s)


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


class RestPath(PathBase):
    """A pose that is held."""

    kind: Literal["rest"]
    pose: PoseOrPosition = Field(description="pose, (x, y, z) or (x, y, z, roll, pitch, yaw) [m, rad]")

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        return Motion.still(np.tile(np.array(self.pose), (len(times), 1)))
