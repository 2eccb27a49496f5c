"""`PathBase`, the base of all paths: a frame, a duration or none, and a pose at every time, with its `Motion`."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BeforeValidator, ValidationInfo

from ....base.display import record
from ....base.inputs import shown
from ....models.part import Part, Pose, Vector3, optional


class Motion(NamedTuple):
    """Poses over time and their derivatives; times come first, coordinates (x, y, z, roll, pitch, yaw) last.

    For a path as a curve, its fraction s replaces the time, and derivatives are with respect to s.
    """

    pose: np.ndarray  # (n, 6) [m, rad]
    velocity: np.ndarray  # (n, 6) [m/s, rad/s]
    acceleration: np.ndarray  # (n, 6) [m/s^2, rad/s^2]

    __repr__ = record

    @classmethod
    def still(cls, pose: np.ndarray) -> Motion:
        """Return poses (n, 6) at rest."""
        return cls(pose, np.zeros_like(pose), np.zeros_like(pose))

    def at(self, rows: Any) -> Motion:
        """Return the motion at some of its times, by an index of NumPy."""
        return Motion(*(part[rows] for part in self))

    def plus(self, deviation: Iterable[np.ndarray]) -> Motion:
        """Add a deviation of pose, velocity and acceleration, coordinate by coordinate."""
        return Motion(*(mine + its for mine, its in zip(self, deviation, strict=True)))

    def timed(self, sd: np.ndarray | float, sdd: np.ndarray | float) -> Motion:
        """Return the motion over time of a curve by s, from ds/dt [1/s] and d2s/dt2 [1/s^2] at its points, (n,)."""
        shape = (-1, *[1] * (self.pose.ndim - 1))
        sd, sdd = np.reshape(sd, shape), np.reshape(sdd, shape)
        return Motion(self.pose, self.velocity * sd, self.velocity * sdd + self.acceleration * sd**2)


class Stations(NamedTuple):
    """The waypoints of a path, in order."""

    names: tuple[str, ...] = ()  # as in the path's file: `points[2]`
    times: np.ndarray = np.zeros(0)  # when the path passes each, or arrives to dwell, (n,) [s]; nan if unknown
    poses: np.ndarray = np.zeros((0, 6))  # in the frame of the path [m, rad]

    @classmethod
    def joined(cls, parts: Iterable[tuple[str, float, Stations]]) -> Stations:
        """Return the waypoints of a sequence of paths, from the key and the start [s] of each."""
        kept = [(key, start, its) for key, start, its in parts if its.names]
        return cls(
            tuple(f"{key}.{name}" for key, _, its in kept for name in its.names),
            np.concatenate([np.zeros(0), *(start + its.times for _, start, its in kept)]),
            np.concatenate([np.zeros((0, 6)), *(its.poses for _, _, its in kept)]),
        )

    @property
    def windows(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the times of the station before each and of the one after it, (n,) each [s]; infinite if unknown."""
        edges = np.concatenate([[-np.inf], self.times, [np.inf]])
        low, high = edges[:-2], edges[2:]
        return np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)

    def since(self, start: float) -> Stations:
        """Return the waypoints from the time `start` [s] on, with times that count from it."""
        later = self.times >= start
        names = tuple(name for name, kept in zip(self.names, later, strict=True) if kept)
        return Stations(names, self.times[later] - start, self.poses[later])


def _with_level_attitude(value: object) -> object:
    """Complete (x, y, z) to a level pose."""
    if not isinstance(value, list | tuple) or len(value) not in (3, 6):
        raise ValueError("must be 3 numbers (x y z) or 6 (x y z roll pitch yaw)")
    return (*value, 0.0, 0.0, 0.0) if len(value) == 3 else value


def or_file(schema: dict[str, Any]) -> None:
    """Add the name of a file to what a schema of points accepts."""
    points = {key: schema.pop(key) for key in ("type", "items", "minItems") if key in schema}
    schema["anyOf"] = [points, {"type": "string"}]


def or_number(schema: dict[str, Any]) -> None:
    """Add one number for all points to what a schema accepts."""
    schema["anyOf"].append({"type": "number", "minimum": 0})


def with_points_of_file(data: dict[str, Any], info: ValidationInfo, wanted: Collection[str]) -> dict[str, Any]:
    """Return a path's fields with those `wanted` of the file that `points` names, and one dwell for each point.

    The points of a file are moved by `origin`, and the fields no longer have it.
    """
    dwell, points, origin = data.get("dwell"), data.get("points"), data.get("origin")
    if origin is not None and not isinstance(points, str):
        raise ValueError("origin must be left out unless points is the name of a file")
    if not isinstance(dwell, int | float | list | tuple | None) or isinstance(dwell, bool):
        raise ValueError(f"dwell must be a number [s] or a list of one for each point, got {shown(dwell)}")
    if isinstance(points, list | tuple) and isinstance(dwell, int | float):
        return data | {"dwell": [dwell] * len(points)}
    if not isinstance(points, str):
        return data
    from .point_file import read_points  # compiles patterns, which lists of points do not need

    read = read_points(data["points"], (info.context or {}).get("folder", Path()))
    read = {name: value for name, value in read.items() if name in wanted}
    for name in read:
        if name != "points" and data.get(name) is not None:
            raise ValueError(f"{name} must be left out, since {data['points']!r} has them")
    if origin is not None:
        by = np.array(origin, dtype=object)
        if by.shape != (3,) or not all(isinstance(x, int | float) and np.isfinite(x) for x in by):
            raise ValueError(f"origin must be three numbers (x y z), got {shown(origin)}")
        read["points"] = [(*(point[:3] + by).tolist(), *point[3:]) for point in read["points"]]
    return data | read | {"origin": None}


FILE_ORIGIN = (
    "position of the coordinate origin of the file of points in the path's frame [m]; default: the frame's origin"
)
PoseOrPosition = Annotated[Pose, BeforeValidator(_with_level_attitude, json_schema_input_type=Pose | Vector3)]


class PathBase(Part):
    """The base of all paths."""

    frame: str = optional("frame of the path: world, or the name of the carrier if the robot has only one", "world")

    @property
    def natural_duration(self) -> float | None:
        """Return the duration by the path's own numbers [s], or None if the task gives it."""
        return None

    @property
    def stretches(self) -> bool:
        """Return whether another duration only changes the time along the path."""
        return self.natural_duration is None and not self.resting

    @property
    def resting(self) -> float:
        """Return for how long of the duration the path dwells [s]."""
        return 0.0

    def rests(self) -> list[tuple[float, float]]:
        """Return s of each inner point at which every motion along the path must rest, and how long it dwells [s]."""
        return []

    def bends(self) -> np.ndarray:
        """Return s where sharp bends begin and end, (n, 2): a grid needs many points there."""
        return np.zeros((0, 2))

    def jumps(self) -> np.ndarray:
        """Return the times at which a time law of its own may change its acceleration abruptly, (n,) [s]."""
        return np.zeros(0)

    def pieces(self, duration: float) -> np.ndarray:
        """Return the beginning and the end of each leg, which may be too short for a time grid to show, (n, 2) [s]."""
        return np.zeros((0, 2))

    def stations(self, duration: float) -> Stations:
        """Return the poses through which a task that lasts `duration` [s] should pass; none by default."""
        return Stations()

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


def check_times(times: tuple[float, ...], count: int, name: str = "times", unit: str = " s") -> None:
    """Refuse times that are not one for each point, from 0 on and increasing."""
    if len(times) != count:
        raise ValueError(f"{name} must have one number for each of the {count} points, got {len(times)}")
    if times[0] != 0:
        raise ValueError(f"{name} must start at 0{unit}, got {times[0]:g}{unit}")
    for index, (before, after) in enumerate(pairwise(times)):
        if after <= before:
            raise ValueError(f"{name} must increase, got {name}[{index + 1}] = {after:g}{unit} after {before:g}{unit}")
