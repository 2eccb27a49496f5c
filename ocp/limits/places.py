"""Limits of distances of platform, bodies that move with it, carriers and cables: from regions, the floor, in a room.

A region that moves with the platform is its body, and its limits have separate names.

Two bodies are apart if no edge of one meets the other, and their distance is the least distance of the edges of each
from the other. Bodies with the same skeleton but round edges are nearer by their radii.
"""

from abc import abstractmethod
from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np
from typing_extensions import override

from ...models import Robot, kinematics
from ...models.part import Box
from ...models.shapes import Shape, skeleton
from .cables import names
from .clearance import cable_outside, point_outside
from .distance import Distance, Pair
from .state import State

ON_BODY = 1e-6  # [m], above the surface of a body: what is less outside counts as a part of it
PLATFORM, LOAD = "platform's body", "load's body"  # in texts
WITHIN = " within "  # in texts, between a body and a side of its room
PLACES = (1 / 3, 2 / 3, 1.0)  # on the way from one instant to the next: so far apart a body cannot jump over a region


class Outside(Distance):
    """Keep out of a region that is `called` so, by a distance of `least` [m].

    Its shape is in {G} or, if it is `riding` on the platform, in the platform's frame.
    """

    per_metre = 1.0

    def __init__(self, place: Shape, called: str, riding: bool, least: float):
        self.place, self.called, self._riding, self.low = place, called, riding, least
        self.region = place  # in whose name it is
        self.thickness = place.thickness
        if riding:  # what is far from the platform moves farther in its frame than its points in {G}
            self.per_metre = np.inf

    @override
    def about(self, index: int) -> str:
        return f"{self.labels[index]} outside {self.called}"

    @property
    @override
    def title(self) -> str:
        return f"{self.name}, {self.called}"

    def _points(self, state: State, points: ca.SX) -> ca.SX:
        """Return points (3, k) of {G} in the frame of the region."""
        return state.on_platform(points) if self._riding else points

    @override
    def apart(self, pair: Pair) -> ca.SX:
        outside = point_outside if pair.points.shape[1] == 1 else cable_outside
        return outside(self.place, *ca.horzsplit(pair.points))


class _PointsOutside(Outside):
    """Keep points, and the lines along which they move, out of a region."""

    @abstractmethod
    def _points_of(self, state: State) -> ca.SX:
        """Return the points in the region's frame, (3, k) [m]."""

    @override
    def pairs(self, state: State) -> list[Pair]:
        return [Pair(point, ca.SX(3, 0)) for point in ca.horzsplit(self._points_of(state))]

    @override
    def on_the_way(self, first: State, second: State) -> ca.SX:
        ways = zip(ca.horzsplit(self._points_of(first)), ca.horzsplit(self._points_of(second)), strict=True)
        return ca.vertcat(*(cable_outside(self.place, *way) for way in ways))


class PlatformOutside(_PointsOutside):
    """Keep the platform's CoM and its attachments, as far as its body leaves them outside, out of a region in {G}."""

    name = "keep_out"

    def __init__(self, robot: Robot, place: Shape, called: str, least: float):
        super().__init__(place, called, False, least)
        points, body = np.vstack([robot.platform.com, robot.attachments]), robot.platform.body
        outside = [body is None or float(point_outside(body, ca.DM(point))) > ON_BODY for point in points]
        self._which = np.flatnonzero(outside).tolist()
        self.labels = ("platform",) * len(self._which)

    @override
    def _points_of(self, state: State) -> ca.SX:
        return ca.horzcat(state.com, state.attachments)[:, self._which]


class CarriersOutside(_PointsOutside):
    """Keep the origins of carriers out of a region."""

    def __init__(self, robot: Robot, which: Sequence[int], place: Shape, called: str, riding: bool, least: float):
        super().__init__(place, called, riding, least)
        self.name = "carrier_platform_clearance" if riding else "keep_out"
        self.labels = tuple(robot.carriers[index].name for index in which)
        self.which = which

    @override
    def _points_of(self, state: State) -> ca.SX:
        return self._points(state, ca.horzcat(*(state.carriers[index].position for index in self.which)))


class CablesOutside(Outside):
    """Keep the cables out of a region."""

    only_between = True

    def __init__(self, robot: Robot, place: Shape, called: str, riding: bool, least: float):
        super().__init__(place, called, riding, least)
        self.name = "cable_platform_clearance" if riding else "keep_out"
        self.labels = names(robot)

    @override
    def pairs(self, state: State) -> list[Pair]:
        anchors = self._points(state, state.anchors)
        ends = ca.SX(ca.DM(state.robot.attachments.T)) if self._riding else state.attachments
        return [Pair(ca.horzcat(ends[:, i], anchors[:, i]), ca.SX(3, 0)) for i in range(state.robot.m)]

    @override
    def on_the_way(self, first: State, second: State) -> ca.SX:
        """Return the values at places between, which are as near for cables as for bodies; nodes have rows too."""
        return ca.vertcat(*(self.values(first.toward(second, share)) for share in PLACES[:-1]))


class BodyOutside(Outside):
    """Keep a body out of a region, by the edges of one of both and the whole of the other."""

    name, per_metre = "keep_out", 1.0  # of the region `riding` on the platform too: all corners of the body count

    def __init__(self, body: Shape, region: Shape, whose: str, called: str, riding: bool, least: float):
        super().__init__(body if riding else region, called, riding, least)
        self.per_metre, self.body, self.region = 1.0, body, region
        self._moving = skeleton(region if riding else body)
        self.labels = (whose,) * len(self._moving.parts)

    @override
    def pairs(self, state: State) -> list[Pair]:
        parts = (np.ascontiguousarray(part) for part in self._moving.parts)
        if self._riding:
            ends = (state.on_platform(ca.SX(ca.DM(part.T))) for part in parts)
        else:
            ends = (kinematics.transform(state.platform.pose, part) for part in parts)
        return [Pair(end, ca.SX(3, 0)) for end in ends]

    @override
    def apart(self, pair: Pair) -> ca.SX:
        return super().apart(pair) - self._moving.radius

    @override
    def on_the_way(self, first: State, second: State) -> ca.SX:
        """Return the values at a few places of the way, which is no edge of a body itself."""
        return ca.vertcat(*(self.values(first.toward(second, share)) for share in PLACES))


def body_outside(body: Shape, whose: str, place: Shape, called: str, least: float) -> Iterator[Distance]:
    """Yield the limits that keep a body in the platform's frame out of a region in {G}, by `least` [m]."""
    solid = skeleton(body).solid
    if skeleton(place).solid or not solid:
        yield BodyOutside(body, place, whose, called, False, least)
    if solid:
        yield BodyOutside(body, place, whose, called, True, least)


class Inside(Distance):
    """Keep points of the platform's frame, and what is within a radius of them, on one side of a plane in {G}."""

    per_metre = 1.0

    def __init__(self, name: str, points: np.ndarray, radius: float, whose: str, axis: int, sign: float, bound: float):
        self.name, self.low = name, 0.0
        self._points, self._radius, self._axis, self._sign, self._bound = points, radius, axis, sign, bound
        self.labels = (whose,) * len(points)
        side = "largest" if sign < 0 else "smallest"
        self._called = "the floor" if name == "floor" else f"the {side} {'xyz'[axis]} of the room"

    @override
    def about(self, index: int) -> str:
        return f"{self.labels[index]}{WITHIN}{self._called}"

    @property
    @override
    def title(self) -> str:
        return f"{self.name}, distance from {self._called}"

    @override
    def pairs(self, state: State) -> list[Pair]:
        points = kinematics.transform(state.platform.pose, self._points)
        return [Pair(point, ca.SX(3, 0)) for point in ca.horzsplit(points)]

    @override
    def apart(self, pair: Pair) -> ca.SX:
        return self._sign * (pair.points[self._axis] - self._bound) - self._radius


def inside_room(
    points: np.ndarray, radius: float, whose: str, floor: float | None, room: Box | None
) -> Iterator[Distance]:
    """Yield the limits that keep points (k, 3) of the platform's frame above a floor [m] and in a room."""
    if floor is not None:
        yield Inside("floor", points, radius, whose, 2, 1.0, floor)
    if room is not None:
        for axis, pair in enumerate(zip(room.min, room.max, strict=True)):
            for sign, bound in zip((1.0, -1.0), pair, strict=True):
                yield Inside("workspace_box", points, radius, whose, axis, sign, bound)
