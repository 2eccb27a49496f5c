"""Limits of distances from keep-out regions for platform, carriers and cables.

A region that moves with the platform is its body, and its limits have separate names.
"""

from abc import abstractmethod
from collections.abc import Sequence

import casadi as ca
import numpy as np
from typing_extensions import override

from ...models import Robot
from .cables import names
from .clearance import Place, cable_outside, point_outside
from .distance import Distance, Pair
from .state import State

ON_BODY = 1e-6  # [m], above the surface of a body: what is less outside counts as a part of it


class Outside(Distance):
    """Keep out of a region that is `called` so, by a distance of `least` [m].

    Its shape is in {G} or, if it is `riding` on the platform, in the platform's frame.
    """

    per_metre = 1.0

    def __init__(self, place: Place, called: str, riding: bool, least: float):
        self.place, self.called, self._riding, self.low = place, called, riding, least
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

    def __init__(self, robot: Robot, place: Place, called: str, least: float):
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

    def __init__(self, robot: Robot, which: Sequence[int], place: Place, called: str, riding: bool, least: float):
        super().__init__(place, called, riding, least)
        self.name = "carrier_platform_clearance" if riding else "keep_out"
        self.labels = tuple(robot.carriers[index].name for index in which)
        self.which = which

    @override
    def _points_of(self, state: State) -> ca.SX:
        return self._points(state, ca.horzcat(*(state.carriers[index].position for index in self.which)))


class CablesOutside(Outside):
    """Keep the cables out of a region."""

    def __init__(self, robot: Robot, place: Place, called: str, riding: bool, least: float):
        super().__init__(place, called, riding, least)
        self.name = "cable_platform_clearance" if riding else "keep_out"
        self.labels = names(robot)

    @override
    def pairs(self, state: State) -> list[Pair]:
        anchors = self._points(state, state.anchors)
        ends = ca.SX(ca.DM(state.robot.attachments.T)) if self._riding else state.attachments
        return [Pair(ca.horzcat(ends[:, i], anchors[:, i]), ca.SX(3, 0)) for i in range(state.robot.m)]
