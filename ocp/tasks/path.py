"""Paths as data: a pose and its first two time derivatives at every time, from a few numbers of a task file."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Literal, NamedTuple, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator
from typing_extensions import override

from ...models.part import Finite, NonNegative, Part, Pose, Positive, Vector3


class Motion(NamedTuple):
    """Poses over time and their derivatives; times come first, coordinates (x, y, z, roll, pitch, yaw) last.

    Where a path is taken as a curve, the fraction s of it stands for the time and derivatives are by s.
    """

    pose: np.ndarray  # (n, 6) [m, rad]
    velocity: np.ndarray  # (n, 6) [m/s, rad/s]
    acceleration: np.ndarray  # (n, 6) [m/s^2, rad/s^2]

    def plus(self, deviation: Iterable[np.ndarray]) -> Motion:
        """Add a deviation of pose, velocity and acceleration, coordinate by coordinate."""
        return Motion(*(mine + its for mine, its in zip(self, deviation, strict=True)))

    def timed(self, sd: np.ndarray, sdd: np.ndarray) -> Motion:
        """Return the motion over time of a curve by s, from ds/dt [1/s] and d2s/dt2 [1/s^2] at its points, (n,)."""
        shape = (-1, *[1] * (self.pose.ndim - 1))
        sd, sdd = np.reshape(sd, shape), np.reshape(sdd, shape)
        return Motion(self.pose, self.velocity * sd, self.velocity * sdd + self.acceleration * sd**2)


def _with_level_attitude(value: object) -> object:
    """Complete (x, y, z) to a level pose."""
    if not isinstance(value, list | tuple) or len(value) not in (3, 6):
        raise ValueError("must be 3 numbers (x y z) or 6 (x y z roll pitch yaw)")
    return (*value, 0.0, 0.0, 0.0) if len(value) == 3 else value


PoseOrPosition = Annotated[Pose, BeforeValidator(_with_level_attitude)]


class PathBase(Part):
    """The base of all paths."""

    frame: str = Field(default="world", description="frame of the path: world, or the name of the only carrier")

    @property
    def natural_duration(self) -> float | None:
        """Return the duration by the path's own numbers [s], or None if the task gives it."""
        return None

    @property
    def stretches(self) -> bool:
        """Return whether another duration means the same places, later or sooner."""
        return False

    def at(self, times: np.ndarray, duration: float) -> Motion:
        """Return pose, velocity and acceleration at `times` [s] of a task that lasts `duration` [s]."""
        raise TypeError(f"{type(self).__name__} is not a path")

    def by_fraction(self, s: np.ndarray, until: float | None = None) -> Motion:
        """Return pose and derivatives by s, the fraction of the path's own time, from 0 to 1.

        `until` is the end of the path by its own time [s]; default: its natural duration, or 1 s.
        """
        whole = until or self.natural_duration or 1.0
        motion = self.at(np.asarray(s) * whole, whole)
        return Motion(motion.pose, motion.velocity * whole, motion.acceleration * whole**2)


class RestPath(PathBase):
    """A pose that is held."""

    kind: Literal["rest"]
    pose: PoseOrPosition = Field(description="(x, y, z) or (x, y, z, roll, pitch, yaw) [m, rad]")

    @property
    @override
    def stretches(self) -> bool:
        return True

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        pose = np.tile(np.array(self.pose), (len(times), 1))
        return Motion(pose, np.zeros_like(pose), np.zeros_like(pose))


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


class CirclePath(PathBase):
    """A circle about the vertical at constant speed, with an optional drift of its centre: a helix."""

    kind: Literal["circle"]
    centre: Vector3 = Field(description="[m]")
    radius: NonNegative = Field(description="[m]")
    rate: Finite = Field(description="[rad/s], positive: counter-clockwise from above")
    phase: Finite = Field(default=0.0, description="angle at the start, from the x axis [rad]")
    drift: Vector3 = Field(default=(0.0, 0.0, 0.0), description="velocity of the centre [m/s]")
    attitude: Vector3 = Field(default=(0.0, 0.0, 0.0), description="constant (roll, pitch, yaw) [rad]")

    @property
    @override
    def natural_duration(self) -> float | None:
        return 2 * np.pi / abs(self.rate) if self.rate else None

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


class WaypointPath(PathBase):
    """A spline through given poses.

    Angles are taken as they are: from 3.1 to -3.1 rad is a turn of 6.2 rad, not of 0.08.
    """

    kind: Literal["waypoints"]
    points: tuple[PoseOrPosition, ...] = Field(min_length=2, description="two poses or positions or more [m, rad]")
    times: tuple[Finite, ...] | None = Field(
        default=None,
        description="time of each point, from 0 on, increasing [s]; default: by distance over the duration",
    )
    timing: Literal["smooth", "uniform"] = Field(
        default="smooth",
        description="smooth: of degree 7, from rest to rest, acceleration and jerk zero there; uniform: the natural "
        "cubic, which rests nowhere",
    )

    @model_validator(mode="after")
    def _times_fit(self) -> Self:
        if self.times is not None:
            _check_times(self.times, len(self.points))
        for index, (before, after) in enumerate(pairwise(self.points)):
            if before == after and self.times is None:
                raise ValueError(f"points[{index + 1}] must differ from points[{index}] unless there are times")
        return self

    @property
    @override
    def natural_duration(self) -> float | None:
        return None if self.times is None else self.times[-1]

    @property
    @override
    def stretches(self) -> bool:
        return self.times is None

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        from scipy.interpolate import CubicSpline, make_interp_spline

        points, knots = np.array(self.points), self.knots(duration)
        if self.timing == "uniform":
            natural = CubicSpline(knots, points, bc_type="natural")
            return Motion(natural(times), natural(times, 1), natural(times, 2))
        at_rest = [(derivative, np.zeros(6)) for derivative in (1, 2, 3)]
        spline = make_interp_spline(knots, points, k=7, bc_type=(at_rest, at_rest))
        return Motion(spline(times), spline(times, 1), spline(times, 2))

    def knots(self, duration: float) -> np.ndarray:
        """Return the times at which the path is at its points [s]."""
        if self.times is not None:
            return np.array(self.times)
        steps = np.linalg.norm(np.diff(np.array(self.points), axis=0), axis=1)  # a radian counts as a metre
        return np.concatenate([[0], np.cumsum(steps)]) / steps.sum() * duration


class SamplePath(PathBase):
    """A quintic spline through samples; speeds at its ends are those of the samples."""

    kind: Literal["samples"]
    times: tuple[Finite, ...] = Field(min_length=6, description="from 0 on, increasing [s]")
    poses: tuple[PoseOrPosition, ...] = Field(min_length=6, description="a pose or position at each time [m, rad]")

    @model_validator(mode="after")
    def _times_fit(self) -> Self:
        _check_times(self.times, len(self.poses))
        return self

    @property
    @override
    def natural_duration(self) -> float | None:
        return self.times[-1]

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        from scipy.interpolate import make_interp_spline

        poses = np.array(self.poses)
        poses[:, 3:] = np.unwrap(poses[:, 3:], axis=0)
        spline = make_interp_spline(np.array(self.times), poses, k=5)
        return Motion(spline(times), spline(times, 1), spline(times, 2))


Curve = Annotated[RestPath | LinePath | CirclePath | WaypointPath | SamplePath, Field(discriminator="kind")]


class TimedPath(PathBase):
    """A path with a time law of its own: d2s/dt2 is constant between the given points of it, then it rests at its end.

    `time_along` makes such.
    """

    kind: Literal["timed"]
    along: Curve = Field(description="the path; s is the fraction of its own time")
    until: Positive | None = Field(
        default=None, description="end of the path by its own time [s]; default: its natural duration"
    )
    s: tuple[Finite, ...] = Field(min_length=2, description="from 0 to 1, increasing")
    speeds: tuple[NonNegative, ...] = Field(min_length=2, description="ds/dt at each s [1/s]")

    @model_validator(mode="after")
    def _law_fits(self) -> Self:
        if len(self.s) != len(self.speeds):
            raise ValueError(f"speeds must have one number for each of the {len(self.s)} s, got {len(self.speeds)}")
        if self.s[0] != 0 or self.s[-1] != 1:
            raise ValueError(f"s must go from 0 to 1, got {self.s[0]:g} to {self.s[-1]:g}")
        for index, (before, after) in enumerate(pairwise(self.s)):
            if after <= before:
                raise ValueError(f"s must increase, got s[{index + 1}] = {after:g} after {before:g}")
        for index, (before, after) in enumerate(pairwise(self.speeds)):
            if before == after == 0:
                raise ValueError(f"speeds must not be 0 twice in a row, got 0 at {index} and {index + 1}")
        if self.frame != self.along.frame:
            raise ValueError(f"frame must be that of along, {self.along.frame!r}, got {self.frame!r}")
        return self

    @cached_property
    def times(self) -> np.ndarray:
        """Return the time at which the path is at each s, (n,) [s]."""
        speeds = np.array(self.speeds)
        return np.concatenate([[0.0], np.cumsum(2 * np.diff(self.s) / (speeds[1:] + speeds[:-1]))])

    @property
    @override
    def natural_duration(self) -> float | None:
        return float(self.times[-1])

    def law(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return s, ds/dt [1/s] and d2s/dt2 [1/s^2] at `times` [s], (n,) each."""
        knots, s, speeds = self.times, np.array(self.s), np.array(self.speeds)
        k = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
        rate = (speeds[k + 1] ** 2 - speeds[k] ** 2) / (2 * (s[k + 1] - s[k]))
        since = np.minimum(times, knots[-1]) - knots[k]
        # The last instant belongs to the motion, as the first does: d2s/dt2 counts there too.
        over = times > knots[-1] * (1 + 1e-12)
        at = s[k] + since * (speeds[k] + since * rate / 2)
        return np.minimum(at, 1.0), np.where(over, 0.0, speeds[k] + since * rate), np.where(over, 0.0, rate)

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        s, sd, sdd = self.law(times)
        return self.along.by_fraction(s, self.until).timed(sd, sdd)


AnyPath = Annotated[
    RestPath | LinePath | CirclePath | WaypointPath | SamplePath | TimedPath, Field(discriminator="kind")
]


def _check_times(times: tuple[float, ...], count: int) -> None:
    if len(times) != count:
        raise ValueError(f"times must have one number for each of the {count} points, got {len(times)}")
    if times[0] != 0:
        raise ValueError(f"times must start at 0 s, got {times[0]:g} s")
    for index, (before, after) in enumerate(pairwise(times)):
        if after <= before:
            raise ValueError(f"times must increase, got times[{index + 1}] = {after:g} s after {before:g} s")
