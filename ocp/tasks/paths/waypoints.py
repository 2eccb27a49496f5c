"""`WaypointPath`: a path through points, by overlapped legs or as a curve of degree 5."""

from collections.abc import Sequence
from functools import cached_property, lru_cache
from itertools import combinations, pairwise
from math import remainder
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, ValidationInfo, model_validator
from typing_extensions import override

from ....models.part import Finite, NonNegative, Vector3, optional
from ....models.points import shortest_way
from .base import (
    FILE_ORIGIN,
    Motion,
    PathBase,
    PoseOrPosition,
    Stations,
    check_times,
    or_file,
    or_number,
    with_points_of_file,
)
from .legs import Legs

NEAREST = 1e-6  # of the length of all steps together: nearer points make a spline turn wildly
STILL = np.zeros(6)
LOOKS = 2001  # at the box of the points
SAME = 1e-12  # [rad], of an attitude after whole turns
GIMBAL = 0.05  # [rad] from a pitch of 90 degrees
GONE = {
    "smooth": "write 'shape: spline' for a smooth curve through the points, or nothing for straight legs",
    "uniform": "write nothing, for straight legs, which `towline time` takes at any speed",
}
MOST = 12  # inner points, for which all subsets are 4096
SHORTER = 1e-9  # relative: of two orders with so little between them the given one stays; of shares: rounding


class WaypointSpline:
    """A spline through points, with its knots by the square root of their distances, which keeps it near to them.

    Velocity and acceleration are zero at its ends. Angles change by less than half a turn from point to point.

    - `points`: (n, 6) poses.
    - `times`: (n,), the times of the points [s]; default: any duration.
    """

    def __init__(self, points: Sequence[Sequence[float]], times: Sequence[float] | None):
        self._points, self._times = np.array(points), None if times is None else np.array(times)
        self._points[:, 3:] = np.unwrap(self._points[:, 3:], axis=0)
        self._steps = np.linalg.norm(np.diff(self._points, axis=0), axis=1)  # a radian is as long as a metre

    def check(self) -> None:
        """Refuse points without times that are too near to each other.

        Raises `ValueError` naming the second of them.
        """
        near = np.flatnonzero(self._steps <= NEAREST * self._steps.sum())
        if self._times is None and near.size:
            index = int(near[0])
            raise ValueError(
                f"points[{index + 1}] must be at least {NEAREST:g} of the path's length away from points[{index}] in "
                f"a spline without times, got {self._steps[index]:.3g} m of {self._steps.sum():.3g} m"
            )

    def knots(self, duration: float) -> np.ndarray:
        """Return the times of the points, (n,) [s]."""
        return duration * self._shares if self._times is None else self._times

    @cached_property
    def _shares(self) -> np.ndarray:
        parts = np.sqrt(self._steps) if self._times is None else np.diff(self._times)
        return np.append(0.0, np.cumsum(parts)) / parts.sum()

    @cached_property
    def _curve(self) -> Any:
        """Return the spline over the share of the time."""
        from scipy.interpolate import make_interp_spline

        rest = [(derivative, STILL) for derivative in (1, 2)]
        return make_interp_spline(self._shares, self._points, k=5, bc_type=(rest, rest))

    def at(self, times: np.ndarray, duration: float) -> Motion:
        """Return the motion of a task that lasts `duration` [s] at `times` [s]."""
        last = duration if self._times is None else self._times[-1]
        s = np.clip(times / last, 0.0, 1.0)
        moving = ((s > 0) & (s < 1))[:, None]
        return Motion(self._curve(s), *(moving * self._curve(s, k) / last**k for k in (1, 2)))


_legs, _spline = lru_cache(maxsize=64)(Legs), lru_cache(maxsize=64)(WaypointSpline)


class WaypointPath(PathBase):
    """Straight legs through given poses; consecutive legs overlap in time.

    The path stays inside the box of its points and passes them at a distance of at most `blend`. It stops at a point
    where it reverses or dwells, and at all points if `blend` is 0. Attitudes turn the shortest way: from 3.1 to -3.1
    rad is a turn of 0.08 rad. In path lengths, 1 rad is treated as 1 m.

    With the shape `spline` the path is a curve of degree 5 from rest to rest that passes exactly through the points but
    may leave their box.
    """

    kind: Literal["waypoints"]
    points: tuple[PoseOrPosition, ...] = Field(
        min_length=2,
        json_schema_extra=or_file,
        description="at least two poses or positions [m, rad]; a task may give the name of a file of points instead, "
        ".csv with units in its header or G-code, relative to the task file",
    )
    origin: Vector3 | None = optional(FILE_ORIGIN)
    shape: Literal["legs", "spline"] = optional(
        "legs: straight, rounded at the points; spline: a smooth curve of degree 5", "legs"
    )
    blend: NonNegative | None = optional(
        "for legs: largest distance from the points [m]; 0: stop at each; default: 1 % of the span of the points"
    )
    order: Literal["given", "free"] = optional(
        "order of the points; free: the order that makes the path shortest, with the first and the last point fixed "
        "and at most 12 between them",
        "given",
    )
    times: tuple[Finite, ...] | None = optional(
        "time at which the path passes each point, from 0 on, increasing [s]; default: spread over the "
        "duration so that all legs have the same peak acceleration; for a spline, in proportion to the square "
        "roots of the distances"
    )
    shares: tuple[Finite, ...] | None = optional(
        "instead of times: share of the duration after which the path passes each point, from 0 to 1, increasing"
    )
    dwell: tuple[NonNegative, ...] | None = optional(
        "for legs: duration of the stop at each point, a number or one for each [s]; included in the "
        "duration; default: no stop",
        json_schema_extra=or_number,
    )

    timing: Literal["smoother"] | None = optional(
        "for legs: smoother: the first five derivatives of each leg are zero at its ends; default: smoother if "
        "quadrotors could otherwise not follow (an exact path of a platform on fewer than six cables)"
    )

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict):
            return data
        timing = data.get("timing")
        if isinstance(timing, str) and timing in GONE:
            raise ValueError(f"'timing' must be 'smoother' or left out of waypoints, got {timing!r}: {GONE[timing]}")
        return with_points_of_file(data, info, ("points", "times", "dwell"))

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.order == "free":
            self._sort()
        if self.times is not None:
            check_times(self.times, len(self.points))
        if self.shares is not None:
            for name in ("times", "dwell"):
                if getattr(self, name) is not None:
                    raise ValueError(f"{name} must be left out with shares")
            check_times(self.shares, len(self.points), "shares", "")
            if abs(self.shares[-1] - 1) > SHORTER:
                raise ValueError(f"shares must end at 1, got {self.shares[-1]:.10g}")
        if self.shape == "spline":
            for name in ("blend", "dwell", "timing"):
                if getattr(self, name) is not None:
                    raise ValueError(f"{name} must be left out with the shape spline, which rests only at its ends")
            self._spline.check()
            return self
        for index, (before, after) in enumerate(pairwise(self.points)):
            turned = [abs(remainder(b - a, 2 * np.pi)) for a, b in zip(before[3:], after[3:], strict=True)]
            if before[:3] == after[:3] and max(turned) < SAME and self.times is self.shares is None:
                raise ValueError(
                    f"points[{index + 1}] must differ from points[{index}] unless there are times; to stop at a "
                    f"point, write dwell; full turns are ignored"
                )
        if self.dwell is not None:
            self._check_dwell(self.dwell)
        self._check_pitch()
        return self

    def _sort(self) -> None:
        """Put points and dwell into the order of the shortest path."""
        for name in ("times", "shares"):
            if getattr(self, name) is not None:
                raise ValueError(f"order must be 'given' with {name}")
        if len(self.points) > MOST + 2:
            raise ValueError(
                f"order must be 'given' for more than {MOST} points between the first and the last, "
                f"got {len(self.points) - 2}"
            )
        order = shortest_order(np.array(self.points))
        object.__setattr__(self, "points", tuple(self.points[index] for index in order))
        if self.dwell is not None and len(self.dwell) == len(order):
            object.__setattr__(self, "dwell", tuple(self.dwell[index] for index in order))

    def _check_dwell(self, dwell: tuple[float, ...]) -> None:
        if len(dwell) != len(self.points):
            raise ValueError(f"dwell must have one number for each of the {len(self.points)} points, got {len(dwell)}")
        for index, (before, after) in enumerate(pairwise(self.times or ())):
            if dwell[index] >= after - before:
                raise ValueError(
                    f"dwell[{index}] must be less than the {after - before:g} s that times give until the next point, "
                    f"got {dwell[index]:g} s"
                )

    def _check_pitch(self) -> None:
        legs = self._legs
        if legs.attitudes.constant:
            return
        s, angles = legs.angles
        worst = int(np.abs(angles[:, 1]).argmax())
        if np.abs(angles[worst, 1]) > np.pi / 2 - GIMBAL or np.isnan(angles).any():
            leg = int(np.searchsorted(legs.places[1:-1], s[worst], side="right"))
            raise ValueError(
                f"points[{leg}] to points[{leg + 1}] must keep the pitch {GIMBAL:g} rad away from 90 degrees, where "
                f"roll and yaw mean the same, got {np.degrees(angles[worst, 1]):.4g} degrees"
            )

    @property
    def _legs(self) -> Legs:
        times, smoother = self.times or self.shares, self.timing == "smoother"
        return _legs(self.points, self.blend, times, self.dwell, self.shares is not None, smoother)

    @property
    def _spline(self) -> WaypointSpline:
        return _spline(self.points, self.times or self.shares)

    @property
    @override
    def natural_duration(self) -> float | None:
        return None if self.times is None else self.times[-1] + (self.dwell or (0.0,))[-1]

    @property
    @override
    def resting(self) -> float:
        return sum(self.dwell or ())

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        shape, times = self._spline if self.shape == "spline" else self._legs, np.asarray(times, dtype=float)
        return (
            shape.at(times, duration)
            if self.shares is None
            else shape.at(times / duration, 1.0).timed(1 / duration, 0.0)
        )

    def knots(self, duration: float) -> np.ndarray:
        """Return the times at which the path passes its points [s]; the arrival times for points with dwell."""
        if self.shares is not None:
            return duration * np.array(self.shares)
        return self._spline.knots(duration) if self.shape == "spline" else self._legs.knots(duration)

    @override
    def pieces(self, duration: float) -> np.ndarray:
        if self.shape == "spline":
            return super().pieces(duration)
        start, last = self._legs.legs(duration if self.shares is None else 1.0)
        return np.stack([start, start + last], axis=1) * (1.0 if self.shares is None else duration)

    @property
    def places(self) -> np.ndarray:
        """Return s of its points, (n,)."""
        if self.shape == "legs":
            return self._legs.places
        whole = self.natural_duration or 1.0
        return self._spline.knots(whole) / whole

    @override
    def stations(self, duration: float) -> Stations:
        names = tuple(f"points[{index}]" for index in range(len(self.points)))
        return Stations(names, self.knots(duration), np.array(self.points))

    def missed(self, duration: float) -> np.ndarray:
        """Return the distances of the points from the path at its knots, (n, 6) [m, rad]."""
        return shortest_way(np.array(self.points) - self.at(self.knots(duration), duration).pose)

    def outside(self) -> np.ndarray:
        """Return the distance by which the path leaves the box of its points along x, y and z, (3,) [m]."""
        duration = self.natural_duration or self.resting + 1.0
        place = self.at(np.linspace(0.0, duration, LOOKS), duration).pose[:, :3]
        points = np.array(self.points)[:, :3]
        return np.maximum(points.min(axis=0) - place, place - points.max(axis=0)).max(axis=0)

    @override
    def by_fraction(self, s: np.ndarray, until: float | None = None) -> Motion:
        """Return pose and derivatives by s: for legs, the fraction of their length or, with `times`, of the time."""
        return super().by_fraction(s, until) if self.shape == "spline" else self._legs.by_fraction(s)

    @override
    def rests(self) -> list[tuple[float, float]]:
        return [] if self.shape == "spline" else self._legs.rests()

    @override
    def bends(self) -> np.ndarray:
        return super().bends() if self.shape == "spline" else self._legs.bends()


def shortest_order(points: np.ndarray) -> list[int]:
    """Return the indices of points (n, 6) [m, rad] in the order of the shortest path; the first and the last one stay.

    1 rad is taken as 1 m, and angles turn the shortest way. Source: M. Held, R. M. Karp, "A dynamic programming
    approach to sequencing problems", 1962.
    """
    distance = np.linalg.norm(shortest_way(points[:, None] - points), axis=2).tolist()
    last, inner = len(points) - 1, range(1, len(points) - 1)
    # By the points that are visited, as a set, and the last one of them: the shortest path so far, and the one before.
    best = {(frozenset([k]), k): (distance[0][k], 0) for k in inner}
    for size in range(2, len(points) - 1):
        for visited in map(frozenset, combinations(inner, size)):
            for k in visited:
                others = visited - {k}
                best[visited, k] = min((best[others, j][0] + distance[j][k], j) for j in others)
    order, visited = [last], frozenset(inner)
    if visited:
        order.append(min(visited, key=lambda k: best[visited, k][0] + distance[k][last]))
    while len(visited) > 1:
        k = order[-1]
        order.append(best[visited, k][1])
        visited -= {k}
    order = [0, *reversed(order)]
    as_given, sorted_ones = (sum(distance[j][k] for j, k in pairwise(each)) for each in (range(last + 1), order))
    return order if sorted_ones < (1 - SHORTER) * as_given else list(range(last + 1))
