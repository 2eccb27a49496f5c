"""`Room`: the bounds of a layout besides the margin: distances and lengths of cables, and the lowest frequency.

A `Region` is a body from which the cables keep a distance, fixed in {G} or moving with the platform.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ..base.errors import InputError
from ..base.text import quantity, quantity_range
from ..models import Robot
from ..models.batch import BLOCK, in_blocks
from ..models.shapes import skeleton
from ..ocp.limits.clearance import cable_outside
from ..workspace.conditions.interference import segment_distance
from .requirements import Requirements

_SPARE = 1e-3  # of a length: how much stricter a search is
_LEAST_SPARE = 0.02  # of the size: a distance below this gets the spare of this


class Region(NamedTuple):
    """A body and the smallest distance of cables from it."""

    name: str  # for reports
    shape: Any  # a `Shape`: these are frozen, and so can be keys of a cache
    riding: bool  # in the frame of the platform, with which it moves; else in {G}
    least: float  # [m]

    def distances(self, ends: np.ndarray, anchors: np.ndarray) -> np.ndarray:
        """Return the distances of cables with ends (n, 3) in the frame of the region, (n,) [m]; negative inside."""
        return in_blocks(_distance(self.shape, False), [ends, anchors])[0][:, 0]

    def spaces(self, ends: np.ndarray, anchors: np.ndarray) -> np.ndarray:
        """Return by how much cables keep the distance, (n,) [m]: exactly if negative, otherwise at least."""
        centre, radius = _ball(self.shape)
        centres = np.broadcast_to(centre, ends.shape)
        found = segment_distance(ends, anchors, centres, centres) - radius - self.least
        near = np.flatnonzero(found < 0.0)
        if near.size:
            found[near] = self.distances(ends[near], anchors[near]) - self.least
        return found

    def slopes(self, ends: np.ndarray, anchors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives of distances by both ends, (n, 3) each."""
        (found,) = in_blocks(_distance(self.shape, True), [ends, anchors])
        return found[:, :3], found[:, 3:]


@lru_cache(maxsize=64)
def _ball(shape: Any) -> tuple[np.ndarray, float]:
    """Return centre (3,) and radius of a ball that contains a shape [m]."""
    its = skeleton(shape)
    centre = its.corners.mean(axis=0)
    return centre, float(np.linalg.norm(its.corners - centre, axis=1).max()) + its.radius


@lru_cache(maxsize=64)
def _distance(shape: Any, slopes: bool) -> ca.Function:
    end, anchor = ca.SX.sym("end", 3), ca.SX.sym("anchor", 3)
    value = cable_outside(shape, end, anchor)
    if slopes:
        value = ca.densify(ca.jacobian(value, ca.vertcat(end, anchor)).T)
    return ca.Function("distance", [end, anchor], [value], {"cse": True}).map(BLOCK)


class Room(NamedTuple):
    """Bounds of distances, lengths, heights and frequencies."""

    clearance: float = 0.0  # smallest distance between two cables [m]; 0: no limit
    shortest: float = 0.0  # lengths of cables [m]
    longest: float = np.inf
    regions: tuple[Region, ...] = ()
    lowest: float = -np.inf  # height of cables in {G} [m]
    frequency: float = 0.0  # lowest natural frequency [Hz]; 0: no limit
    size: float = 1.0  # of the robot [m]

    @property
    def limits_lengths(self) -> bool:
        """Return whether there are lengths that cables must not have."""
        return self.shortest > 0.0 or self.longest < np.inf

    def with_spare(self, share: float) -> "Room":
        """Return stricter bounds: distances and a frequency that are larger by a share, lengths a little inside."""
        least = _LEAST_SPARE * self.size
        return self._replace(
            clearance=self.clearance + share * max(self.clearance, least) if self.clearance > 0.0 else 0.0,
            shortest=self.shortest * (1.0 + _SPARE),
            longest=self.longest * (1.0 - _SPARE),
            regions=tuple(each._replace(least=each.least + share * max(each.least, least)) for each in self.regions),
            frequency=self.frequency * (1.0 + share),
        )

    def describe(self) -> list[str]:
        """Return each bound as a text."""
        found = [f"clearance of {quantity(self.clearance, 'm')}"] * (self.clearance > 0.0)
        found += [f"cable length of {quantity_range((self.shortest, self.longest), 'm')}"] * self.limits_lengths
        found += [f"distance of {quantity(each.least, 'm')} between cables and {each.name}" for each in self.regions]
        found += [f"height of cables of {quantity(self.lowest, 'm')}"] * (self.lowest > -np.inf)
        return found + [f"natural frequency of {quantity(self.frequency, 'Hz')}"] * (self.frequency > 0.0)


def room_of(robot: Robot, requirements: Requirements) -> Room:
    """Return the room of a design.

    Raises `InputError` if a requirement is about a body or a floor that the robot's file does not have.
    """
    lengths, height = requirements.cable_length, requirements.cable_floor_clearance
    if height is not None and robot.floor is None:
        raise InputError(
            f"cable_floor_clearance must be left out without a floor, which robot {robot.name!r} does not have, got "
            f"{height:g}"
        )
    return Room(
        requirements.clearance,
        *((0.0, np.inf) if lengths is None else (lengths.min, lengths.max)),
        regions=tuple(_regions(robot, requirements)),
        lowest=-np.inf if height is None or robot.floor is None else robot.floor + height,
        frequency=requirements.natural_frequency or 0.0,
        size=robot.size,
    )


def _regions(robot: Robot, requirements: Requirements) -> Iterator[Region]:
    for place in requirements.keep_out:
        if place.cables is not None:
            yield Region(place.name, place, place.frame == "platform", place.cables)
    distance = requirements.cable_platform_clearance
    if distance is not None:
        if robot.platform.body is None:
            raise InputError(
                f"cable_platform_clearance must be left out without platform.body, which robot {robot.name!r} does not "
                f"have, got {distance:g}"
            )
        yield Region("the platform", robot.platform.body, True, distance)
