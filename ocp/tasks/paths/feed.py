"""`FeedPath`: lines through points at a steady speed, as machines work along them, with rounded corners.

A corner is a Bezier curve of degree 5 whose first and last three control points lie on the two lines, so that the
curvature rises from zero and returns to it. Its size follows from how far it may miss the corner.
"""

from functools import cached_property
from itertools import pairwise
from math import comb, pi, sqrt
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, ValidationInfo, model_validator
from typing_extensions import override

from ....base.text import counted, quantity
from ....models.part import NonNegative, Positive, Vector3, optional
from .base import FILE_ORIGIN, Motion, PathBase, PoseOrPosition, or_file, or_number, with_points_of_file
from .timed import TimeLaw

STRAIGHT = 1e-9  # [rad]: a smaller turn is none
TURNS_BACK = 0.95 * pi  # [rad]: at a sharper corner the motion stops
CELLS = 16  # of a corner, in each of which the curvature is bounded
NEAR_END = 0.17  # place of the second control point, as a share of the way from the end of a corner to its tip
# The third one, by the turn [rad]: with it the peak of the curvature is the least for a given miss, within 1 %.
TURNS, NEAR_TIP = (0.0, pi / 4, pi / 2, 3 * pi / 4, pi), (0.78, 0.71, 0.61, 0.43, 0.2)
IN_CELL, BETWEEN = 8, 1.002  # places in each cell, between which the curvature may be so many times as large
BLOCK = 20_000  # places of corners that are computed together: more would take memory, not less time
MOST = 0.5  # of the shorter line at a corner
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
SAME = 1e-12  # [rad]
STEADY, LOOKS = 0.02, 20_001  # of the feed; instants at which the speed is looked at
SHORTEST = 1e-12  # of the length: a shorter piece has no nodes


class Places(NamedTuple):
    """Places of a curve, with derivatives by its length."""

    position: np.ndarray  # (n, 3) [m]
    tangent: np.ndarray  # (n, 3), of length one
    bend: np.ndarray  # (n, 3) [1/m], the second derivative


class RoundedCorners:
    """Lines through points with rounded corners.

    - `points`: (n, 3) [m]; neighbours differ.
    - `tolerance`: by how much the curve may miss a corner [m].
    - `stops`: points at which the motion stops anyway, (n,): their corners stay sharp.
    - `lengths`, `curvature`: of each corner, (n - 2,): the length up to the ends of its cells, (CELLS + 1,) [m], and
      the largest curvature in them, (CELLS,) [1/m].
    """

    def __init__(self, points: np.ndarray, tolerance: float, stops: np.ndarray):
        lines = np.diff(points, axis=0)
        long = np.linalg.norm(lines, axis=1)
        self._points, self._along = points, lines / long[:, None]
        before, after = self._along[:-1], self._along[1:]
        turn = 2 * np.arctan2(np.linalg.norm(after - before, axis=1), np.linalg.norm(after + before, axis=1))
        self.sharp = stops | np.r_[True, turn > TURNS_BACK, True]  # points at which a motion must stop, (n,)
        rounded = (turn > STRAIGHT) & ~self.sharp[1:-1]
        tip = np.interp(turn, TURNS, NEAR_TIP)
        # B(1/2) misses the tip by this much for each metre that is cut off the lines.
        missed = 2 * np.sin(turn / 2) * (1 + 5 * (1 - NEAR_END) + 10 * (1 - tip)) / 32
        room = MOST * np.minimum(long[:-1], long[1:])
        cut = np.where(rounded, np.minimum(tolerance / np.where(rounded, missed, 1.0), room), 0.0)
        offsets = -np.stack([np.ones_like(tip), np.full_like(tip, 1 - NEAR_END), 1 - tip], axis=1) * cut[:, None]
        control = np.concatenate([offsets[:, :, None] * before[:, None], -offsets[:, ::-1, None] * after[:, None]], 1)
        self._control = [points[1:-1, None] + control]  # also of the derivatives, (n - 2, 6 - order, 3)
        for degree in (5, 4):
            self._control.append(degree * np.diff(self._control[-1], axis=1))
        self._ends = np.linspace(0.0, 1.0, CELLS + 1)
        inner = (self._ends[:-1, None] + (1 + _NODES) / 2 / CELLS).ravel()
        speed, _ = self._sizes(inner)
        self.lengths = np.pad(
            np.cumsum(speed.reshape(-1, CELLS, len(_NODES)) @ _WEIGHTS / 2 / CELLS, axis=1), ((0, 0), (1, 0))
        )
        speed, crossed = self._sizes(np.linspace(0.0, 1.0, CELLS * IN_CELL + 1))
        curvature = np.divide(crossed, speed**3, out=np.zeros_like(speed), where=speed > 0)
        cells = np.arange(CELLS)[:, None] * IN_CELL + np.arange(IN_CELL + 1)  # with both ends
        self.curvature = BETWEEN * curvature[:, cells].max(axis=2)
        straight = long - np.append(0.0, cut) - np.append(cut, 0.0)
        pieces = np.zeros(2 * len(long) - 1)
        pieces[::2], pieces[1::2] = np.maximum(straight, 0.0), self.lengths[:, -1]
        # lengths at which the pieces begin and end, (2 n - 2,) [m]: line, corner, line, ... , line.
        self.edges = np.append(0.0, np.cumsum(pieces))
        # lengths at the points, in the middle of their corners, (n,) [m]
        self.tips = np.concatenate([[0.0], (self.edges[1:-1:2] + self.edges[2:-1:2]) / 2, self.edges[-1:]])
        self._starts = points[:-1] + np.append(0.0, cut)[:, None] * self._along

    def at(self, length: np.ndarray) -> Places:
        """Return the places at lengths from 0 to the last edge, (n,) [m]."""
        blocks = [self._at(some) for some in np.array_split(length, len(length) // BLOCK + 1)]
        return Places(*map(np.concatenate, zip(*blocks, strict=True)))

    def _at(self, length: np.ndarray) -> Places:
        piece = np.clip(np.searchsorted(self.edges, length, side="right") - 1, 0, len(self.edges) - 2)
        line, since = piece // 2, length - self.edges[piece]
        tangent, bend = self._along[line].copy(), np.zeros((len(length), 3))
        position = self._starts[line] + since[:, None] * tangent
        turning = np.flatnonzero((piece % 2 == 1) & (self.edges[piece + 1] > self.edges[piece]))
        corner = line[turning]
        share = self._share(corner, since[turning])
        position[turning], first, second = (self._bezier(corner, share, order) for order in range(3))
        speed = np.linalg.norm(first, axis=1, keepdims=True)
        tangent[turning] = first / speed
        across = second - tangent[turning] * np.sum(second * tangent[turning], axis=1, keepdims=True)
        bend[turning] = across / speed**2
        return Places(position, tangent, bend)

    def _sizes(self, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the speed of all corners at parameters (k,), and the area of velocity and acceleration, (n - 2, k)."""
        count, sizes = len(self._control[0]), []
        for some in np.array_split(np.arange(count), count * len(share) // BLOCK + 1):
            at = np.repeat(some, len(share)), np.tile(share, len(some))
            first, second = self._bezier(*at, 1), self._bezier(*at, 2)
            sizes.append(np.linalg.norm([first, np.cross(first, second)], axis=2))
        speed, crossed = np.concatenate(sizes, axis=1).reshape(2, count, len(share))
        return speed, crossed

    def _share(self, corner: np.ndarray, since: np.ndarray) -> np.ndarray:
        """Return the parameter of corners at lengths from their beginnings, (n,), by Newton's method."""
        known = self.lengths[corner]  # (n, CELLS + 1)
        cell = np.clip((known <= since[:, None]).sum(axis=1) - 1, 0, CELLS - 1)
        rows, start = np.arange(len(cell)), self._ends[cell]
        before, after = known[rows, cell], known[rows, cell + 1]
        share = start + (since - before) / (after - before) / CELLS
        for _ in range(3):
            half = (share - start) / 2
            inner = start[:, None] + half[:, None] * (1 + _NODES)  # (n, 5)
            first = self._bezier(np.repeat(corner, len(_NODES)), inner.ravel(), 1)
            covered = before + half * (np.linalg.norm(first, axis=1).reshape(inner.shape) @ _WEIGHTS)
            speed = np.linalg.norm(self._bezier(corner, share, 1), axis=1)
            share = share - (covered - since) / speed
        return share

    def _bezier(self, corner: np.ndarray, share: np.ndarray, order: int) -> np.ndarray:
        """Return corners at a parameter from 0 to 1, (n,), or their derivative of an order by it, (n, 3)."""
        degree = 5 - order
        weights = [comb(degree, k) * share**k * (1 - share) ** (degree - k) for k in range(degree + 1)]
        return np.einsum("kn,nkj->nj", np.array(weights), self._control[order][corner])


class FeedPath(PathBase):
    """Lines through given positions at a steady speed, the feed; corners are rounded within a tolerance.

    The speed is the feed, except where the limited acceleration requires less: at sharp corners, and while starting and
    stopping. At points with a dwell, and where the path turns back, the motion stops. The attitude is the same
    everywhere.
    """

    kind: Literal["feed"]
    points: tuple[PoseOrPosition, ...] = Field(
        min_length=2,
        json_schema_extra=or_file,
        description="at least two positions [m], or poses with the same attitude [m, rad]; a task may give the name of "
        "a file of points instead, .csv with units in its header or G-code, relative to the task file",
    )
    origin: Vector3 | None = optional(FILE_ORIGIN)
    feed: Positive | None = optional("speed [m/s]; default: the feed of each line of a .gcode file")
    acceleration: Positive = Field(description="largest acceleration, along the path and across it in corners [m/s^2]")
    tolerance: NonNegative = optional(
        "largest distance at which the path passes a corner [m]; 0: stop at each corner", 1e-3
    )
    feeds: tuple[Positive, ...] | None = optional("speed of each line, instead of `feed` [m/s]")
    dwell: tuple[NonNegative, ...] | None = optional(
        "duration of the stop at each point, a number or one for each [s]; default: no stop",
        json_schema_extra=or_number,
    )
    ignored: tuple[str, ...] = optional("words of the .gcode file that were not used", ())

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict):
            return data
        read = with_points_of_file(data, info, ("points", "feeds", "dwell", "ignored"))
        if data.get("feed") is not None and data.get("feeds") is None:
            read.pop("feeds", None)  # those of the file
        return read

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if (self.feed is None) == (self.feeds is None):
            raise ValueError("feed must be given once: one for all lines, or feeds, one for each")
        count = len(self.points)
        if self.feeds is not None and len(self.feeds) != count - 1:
            raise ValueError(f"feeds must have one number for each of the {count - 1} lines, got {len(self.feeds)}")
        if self.dwell is not None and len(self.dwell) != count:
            raise ValueError(f"dwell must have one number for each of the {count} points, got {len(self.dwell)}")
        for index, (before, after) in enumerate(pairwise(self.points)):
            if before[:3] == after[:3]:
                raise ValueError(
                    f"points[{index + 1}] must differ from points[{index}]; to stop at a point, write dwell"
                )
            if max(abs(a - b) for a, b in zip(before[3:], after[3:], strict=True)) > SAME:
                raise ValueError(
                    f"points[{index + 1}] must have the attitude of points[0], which is constant on a path of kind feed"
                )
        length = float(np.linalg.norm(np.diff(np.array(self.points)[:, :3], axis=0), axis=1).sum())
        least = sqrt(2 * self.acceleration * SHORTEST * length)
        if float(self._feeds.min()) <= least:
            key = "feed" if self.feeds is None else "feeds"
            raise ValueError(
                f"{key} must be more than {least:.3g} m/s on {length:.3g} m, got {self._feeds.min():g} m/s"
            )
        return self

    @cached_property
    def curve(self) -> RoundedCorners:
        """Return the curve with its corners rounded, as a function of the length along it."""
        stops = np.array(self.dwell or np.zeros(len(self.points))) > 0
        return RoundedCorners(np.array(self.points)[:, :3], self.tolerance, stops | (self.tolerance == 0))

    @cached_property
    def law(self) -> TimeLaw:
        """Return the length along the curve as a function of time."""
        curve, a = self.curve, self.acceleration
        nodes, curvature = _cells(curve)
        feed = self._feed_at((nodes[1:] + nodes[:-1]) / 2)
        with np.errstate(divide="ignore"):
            most = np.minimum(feed**2, a / curvature)  # of the squared speed, in each cell
        square = np.minimum(np.append(most, 0.0), np.append(0.0, most))
        stops = np.searchsorted(nodes, curve.tips[curve.sharp] - SHORTEST * nodes[-1])
        square[stops] = 0.0
        reach, bent = 2 * a * np.diff(nodes), 2 * curvature * np.diff(nodes)
        square = _reached(square, reach, bent)
        square = _reached(square[::-1], reach[::-1], bent[::-1])[::-1]
        dwell = np.zeros(len(nodes))
        if self.dwell is not None:
            dwell[stops] = np.array(self.dwell)[curve.sharp]
        # On a line the speed rises and falls by the whole acceleration, between its ends and the feed.
        rise, fall = square[:-1], square[1:]
        top = np.minimum(feed**2, (rise + fall) / 2 + a * np.diff(nodes))
        up, down = nodes[:-1] + (top - rise) / (2 * a), nodes[1:] - (top - fall) / (2 * a)
        line, least = curvature == 0, SHORTEST * nodes[-1]
        rises = line & (up > nodes[:-1] + least) & (up < nodes[1:] - least)
        falls = line & (down > up + least) & (down < nodes[1:] - least)
        s = np.concatenate([nodes, up[rises], down[falls]])
        order = np.argsort(s, kind="stable")
        speeds = np.sqrt(np.concatenate([square, top[rises], top[falls]]))
        return TimeLaw(s[order], speeds[order], np.pad(dwell, (0, len(s) - len(dwell)))[order])

    def steadiness(self) -> str:
        """Return the fraction of the time at the feed, and where the motion is slowest between its ends."""
        length, speed, _ = self.law.at(np.linspace(0.0, self.law.duration, LOOKS))
        share = float(np.mean(speed >= (1 - STEADY) * self._feed_at(length)))
        slower = self.law.at(self.law.time_at(self.curve.tips))[1] / self._feed_at(self.curve.tips)
        between = (slower < 1 - STEADY) & ~self.curve.sharp
        text = f"within {quantity(100 * STEADY, '%')} for {quantity(100 * share, '%', digits=3)} of the time"
        if between.any():
            worst = int(np.argmin(np.where(between, slower, np.inf)))
            percent = quantity(100 * slower[worst], "%", digits=3)
            text += f"; slower in {counted(between.sum(), 'corner')}, down to {percent} of the feed at points[{worst}]"
        stops = int(self.curve.sharp[1:-1].sum())
        return text + (f"; {counted(stops, 'stop')} between the ends" if stops else "")

    def _feed_at(self, length: np.ndarray) -> np.ndarray:
        """Return the feed at lengths of the curve, (n,) [m/s]."""
        piece = np.clip(np.searchsorted(self.curve.edges, length, side="right") - 1, 0, len(self.curve.edges) - 2)
        line = piece // 2
        after = np.minimum(line + piece % 2, len(self.points) - 2)
        return np.minimum(self._feeds[line], self._feeds[after])

    @property
    def _feeds(self) -> np.ndarray:
        """Return the feed of each line, (n - 1,) [m/s]."""
        return np.full(len(self.points) - 1, self.feed) if self.feeds is None else np.array(self.feeds)

    @property
    @override
    def natural_duration(self) -> float | None:
        return self.law.duration

    @property
    @override
    def resting(self) -> float:
        return sum(self.dwell or ())

    @override
    def jumps(self) -> np.ndarray:
        return self.law.jumps()

    @override
    def at(self, times: np.ndarray, duration: float) -> Motion:
        length, speed, rate = self.law.at(np.asarray(times, dtype=float))
        position, tangent, bend = self.curve.at(length)
        pose, velocity, acceleration = (np.zeros((len(length), 6)) for _ in range(3))
        pose[:] = self.points[0]
        pose[:, :3], velocity[:, :3] = position, tangent * speed[:, None]
        acceleration[:, :3] = tangent * rate[:, None] + bend * speed[:, None] ** 2
        return Motion(pose, velocity, acceleration)


def _cells(curve: RoundedCorners) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of cells of the curve, (k + 1,) [m], and the largest curvature in each, (k,) [1/m]."""
    corners = curve.edges[1:-1:2, None] + curve.lengths  # (n - 2, CELLS + 1)
    nodes = np.unique(np.concatenate([curve.edges[[0, -1]], corners.ravel()]))
    nodes = nodes[np.diff(nodes, append=np.inf) > SHORTEST * nodes[-1]]
    middle = (nodes[1:] + nodes[:-1]) / 2
    piece = np.clip(np.searchsorted(curve.edges, middle, side="right") - 1, 0, len(curve.edges) - 2)
    turns = np.flatnonzero(piece % 2 == 1)
    curvature, corner = np.zeros(len(middle)), piece[turns] // 2
    cell = np.clip((corners[corner] <= middle[turns, None]).sum(axis=1) - 1, 0, CELLS - 1)
    curvature[turns] = curve.curvature[corner, cell]
    return nodes, curvature


def _reached(square: np.ndarray, reach: np.ndarray, bent: np.ndarray) -> np.ndarray:
    """Return the squared speeds at the ends of cells, (k + 1,), that are reached one after the other.

    In a cell of the length h and the curvature c the acceleration along the path leaves room for that across it,
    |a_t|^2 + (c v^2)^2 <= a^2: `reach` is 2 a h and `bent` 2 c h, so that y from x obeys (y - x)^2 + (bent y)^2 <=
    reach^2.
    """
    x = float(square[0])
    result, whole = [x], (1 + bent**2).tolist()
    for most, r, b, w in zip(square[1:].tolist(), reach.tolist(), bent.tolist(), whole, strict=True):
        x = min(most, (x + sqrt(max(w * r * r - (b * x) ** 2, 0.0))) / w)
        result.append(x)
    return np.array(result)
