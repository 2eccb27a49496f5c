"""`SequencePath`: paths one after the other; `ReturnPath`: the remainder of a path plus a decaying offset."""

from collections.abc import Collection, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator
from typing_extensions import override

from ....models.part import AT_ORIGIN, NonNegative, Part, Pose, Positive, optional
from .. import bernstein
from .base import Motion, PathBase, Stations
from .circle import CirclePath
from .feed import FeedPath
from .line import LinePath, RestPath
from .samples import SamplePath
from .timed import TimedPath
from .waypoints import WaypointPath

JOINED = 1e-7  # [m, rad, and per second and second squared]: a smaller gap is rounding

SinglePath: TypeAlias = Annotated[
    RestPath | LinePath | CirclePath | WaypointPath | SamplePath | FeedPath | TimedPath, Field(discriminator="kind")
]


class Piece(Part):
    """One path of a sequence."""

    path: SinglePath = Field(description="path in the frame of the sequence")
    duration: Positive | None = optional("duration [s]; default: the path's own")

    @property
    def seconds(self) -> float:
        """Return the duration [s]."""
        return lasting(self.path, self.duration)

    @model_validator(mode="after")
    def _lasts(self) -> Self:
        lasting(self.path, self.duration)
        return self


class SequencePath(PathBase):
    """A sequence of paths: each begins with the pose, velocity and acceleration at the end of the previous one."""

    kind: Literal["sequence"]
    parts: tuple[Piece, ...] = Field(min_length=1, description="paths in the frame of the sequence, with durations")

    @model_validator(mode="after")
    def _joins(self) -> Self:
        for index, part in enumerate(self.parts):
            if part.path.frame != self.frame:
                raise ValueError(
                    f"parts[{index}].path.frame must be {self.frame!r}, the frame of the sequence, "
                    f"got {part.path.frame!r}"
                )
        check_continuity([(part.path, part.seconds) for part in self.parts], "parts")
        return self

    @cached_property
    def boundaries(self) -> np.ndarray:
        """Return the times at which the parts begin, and the end, (n + 1,) [s]."""
        return np.append(0.0, np.cumsum([part.seconds for part in self.parts]))

    @property
    @override
    def natural_duration(self) -> float | None:
        return float(self.boundaries[-1])

    @override
    def jumps(self) -> np.ndarray:
        parts = zip(self.parts, self.boundaries, strict=False)
        return np.concatenate([start + part.path.jumps() for part, start in parts])

    @override
    def pieces(self, duration: float) -> np.ndarray:
        parts = zip(self.parts, self.boundaries, strict=False)
        return np.concatenate([start + part.path.pieces(part.seconds) for part, start in parts])

    @override
    def stations(self, duration: float) -> Stations:
        parts = zip(self.parts, self.boundaries, strict=False)
        return Stations.joined(
            (f"parts[{index}].path", float(start), part.path.stations(part.seconds))
            for index, (part, start) in enumerate(parts)
        )

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        motion = Motion(*(np.empty((len(times), 6)) for _ in range(3)))
        which = np.searchsorted(self.boundaries[1:-1], times, side="right")
        for index, part in enumerate(self.parts):
            rows = which == index
            if rows.any():
                piece = part.path.at(times[rows] - self.boundaries[index], part.seconds)
                for whole, its in zip(motion, piece, strict=True):
                    whole[rows] = its
        return motion


def lasting(path: SinglePath, duration: float | None) -> float:
    """Return the duration of a path of a sequence [s].

    Raises `ValueError` naming `duration`, if that is missing or does not fit the path.
    """
    own = path.natural_duration
    if duration is None:
        if own is None:
            raise ValueError(f"duration must be a number > 0 [s] for a path of kind {path.kind}, got nothing")
        return own
    if path.kind in ("waypoints", "samples", "feed") and own is not None and abs(duration - own) > 1e-9 * own:
        raise ValueError(f"duration must be {own:g} s, where the times of path end, got {duration:g} s")
    if duration <= path.resting:
        raise ValueError(f"duration must be more than the {path.resting:g} s for which path dwells, got {duration:g} s")
    return duration


def check_continuity(paths: Sequence[tuple[SinglePath, float]], key: str, resting: Collection[int] = ()) -> None:
    """Check that each of the paths, with their durations [s], begins where and as the one before ends.

    The acceleration may jump if one of them has a law whose acceleration does, and neither is `resting` on the ground.

    Raises `ValueError` naming the first one that does not, as an item of `key`, and the gap.
    """
    for index, ((before, lasts), (after, seconds)) in enumerate(pairwise(paths)):
        end, start = before.at(np.array([lasts]), lasts), after.at(np.zeros(1), seconds)
        words = (("where", "", ("m", "rad")), ("with the speed with which", "of speed ", ("m/s", "rad/s")))
        words += (("with the acceleration with which", "of acceleration ", ("m/s^2", "rad/s^2")),)
        jumps = np.isclose(before.jumps(), lasts).any() or np.isclose(after.jumps(), 0.0).any()
        jumps &= not {index, index + 1} & set(resting)
        for there, here, (how, what, units) in zip(end, start, words[: 2 if jumps else 3], strict=False):
            gap = here[0] - there[0]
            if np.abs(gap).max() > JOINED:
                far, turned = np.linalg.norm(gap[:3]), np.abs(gap[3:]).max()
                raise ValueError(
                    f"{key}[{index + 1}] must begin {how} {key}[{index}] ends, got a gap {what}of "
                    f"{far:.4g} {units[0]} and {turned:.4g} {units[1]}"
                )


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
