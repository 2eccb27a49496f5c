"""`ReturnPath`: the remainder of a path plus a decaying offset, for a robot with a tracking error."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator
from typing_extensions import override

from ....models.part import AT_ORIGIN, NonNegative, Pose, Positive, optional
from .. import bernstein
from .base import PathBase
from .motion import Motion
from .sequence import SequencePath, SinglePath
from .stations import Stations


class ReturnPath(PathBase):
    """The remainder of a path from `start` on, plus an offset that decays to zero as a polynomial of degree 5.

    `Planner.replan` creates such paths.
    """

    kind: Literal["return"]
    path: Annotated[SinglePath | SequencePath, Field(discriminator="kind")] = Field(description="the whole path")
    duration: Positive = Field(description="duration of the whole path [s]")
    start: NonNegative = Field(description="time on the whole path at which the remainder starts [s]")
    settle: Positive = Field(description="time after which the offset is zero [s]")
    offset: Pose = optional("offset from the path at the start [m, rad]", AT_ORIGIN)
    offset_velocity: Pose = optional("time derivative of the offset at the start [m/s, rad/s]", AT_ORIGIN)
    offset_acceleration: Pose = optional(
        "second time derivative of the offset at the start [m/s^2, rad/s^2]", AT_ORIGIN
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.frame != self.path.frame:
            raise ValueError(f"frame must equal path.frame, {self.path.frame!r}, got {self.frame!r}")
        if not self.start < self.duration:
            raise ValueError(f"start must be less than duration, {self.duration:g} s, got {self.start:g} s")
        if self.settle > (self.duration - self.start) * (1 + 1e-9):
            left = self.duration - self.start
            raise ValueError(f"settle must be at most the {left:g} s that are left, got {self.settle:g} s")
        return self

    @property
    @override
    def natural_duration(self) -> float | None:
        return self.duration - self.start

    @override
    def jumps(self) -> np.ndarray:
        return self.path.jumps() - self.start

    @override
    def pieces(self, duration: float) -> np.ndarray:
        return self.path.pieces(self.duration) - self.start

    @override
    def stations(self, duration: float) -> Stations:
        return self.path.stations(self.duration).since(self.start)

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        offset = np.array([self.offset, self.offset_velocity, self.offset_acceleration])
        motion = self.path.at(times + self.start, self.duration)
        early, off = times < self.settle, np.zeros((3, len(times), 6))
        off[:, early] = decay(times[early], self.settle, offset)
        return motion.plus(off)


def decay(times: np.ndarray, settle: float, offset: np.ndarray) -> list[np.ndarray]:
    """Return a value and its first two derivatives at `times`, (n, k) each, which are zero from `settle` [s] on.

    They start as `offset` (3, k), and the value is a polynomial of degree 5.
    """
    value, rate, bend = offset
    near = value + settle / 5 * rate
    points, motion = [value, near, 2 * near - value + settle**2 / 20 * bend, *np.zeros((3, len(value)))], []
    for _ in offset:
        motion.append(bernstein.basis(len(points) - 1, np.minimum(times / settle, 1.0)) @ np.array(points))
        points = bernstein.derivative(settle, points)
    return motion
