"""Positions of which a plan warns: carriers whose bodies meet regions or one another, a platform outside its frame."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ...base.display import Displayed
from ...base.errors import InputError
from ...base.text import quantity, quantity_row
from ...models import Dynamics, Robot, points
from ...models.shapes import BodyHull
from ..limits.limit import Limit
from ..limits.limits import Limits
from ..limits.places import CarriersOutside, PlatformOutside, body_outside
from ..tasks.paths import PathBase, WaypointPath

LEAST = 1e-4  # [m]: less is within the tolerances of a program
Limited = Callable[[Sequence[Limit]], list[np.ndarray]]
Meeting = tuple[float, str]  # by how much [m], and the sentence
MOST = 200  # instants that are looked at, or less than twice as many
ENTERED = 1e-3  # [m]: less inside is not worth a sentence
NEAR = 1e-3  # [m], and of the size of the frame, whichever is less: nearer than this it is inside
FLAT = 0.1  # of the largest span of the anchors: an axis along which they span less has no sides
AXES = "xyz"
LEFT = 1e-3  # of the span of the points
LEAVES = "the platform leaves the frame of the robot"


@dataclass(frozen=True)
class Instants(Displayed):
    """Compute where the parts of a robot are at some instants of its motion, in {G}."""

    dynamics: Dynamics
    times: np.ndarray  # (n,) [s]
    pose: np.ndarray  # (n, 6) [m, rad], of the platform
    carriers: np.ndarray  # (n, c, 6) [m, rad]

    @property
    def robot(self) -> Robot:
        """Return the robot."""
        return self.dynamics.robot

    @cached_property
    def anchors(self) -> np.ndarray:
        """Return the anchors, (n, m, 3) [m]."""
        return points.anchors(self.robot, self.carriers)

    @cached_property
    def platform(self) -> np.ndarray:
        """Return the CoM of the platform and its attachments, (n, 1 + m, 3) [m]."""
        return points.placed(self.pose, np.vstack([self.robot.platform.com, self.robot.attachments]))


def into_places(seen: Instants, limits: Iterable[Limit], limited: Limited) -> list[str]:
    """Return a sentence if a carrier enters a region, because the task states less than the radius of its body.

    `limited` returns what some of the task's `limits` bound at the instants, (n, k) each.
    """
    robot, radii, meetings = seen.robot, seen.robot.carrier_radius, []
    less = [limit for limit in limits if isinstance(limit, CarriersOutside) and limit.low < radii.max() - LEAST]
    for limit, values in zip(less, limited(less), strict=True):
        for column, index in enumerate(limit.which):
            radius, row = radii[index], int(values[:, column].argmin())
            if limit.low < radius - LEAST and values[row, column] < radius - LEAST:
                name, distance = robot.carriers[index].name, quantity(abs(values[row, column]), "m", 3)
                comes = f"comes within {distance} of" if values[row, column] >= 0 else f"is {distance} inside"
                sentence = f"the centre of {name} {comes} {limit.called!r} at t = {seen.times[row]:.3f} s"
                wide = f", inside the radius of its body, {quantity(radius, 'm', 3)}"
                meetings.append((float(radius - values[row, column]), sentence + wide))
    return _worst(meetings, "carriers: radius, the default, keeps the whole body outside")


def into_each_other(seen: Instants) -> list[str]:
    """Return a sentence if two carriers come nearer to each other than the radii of both bodies together."""
    robot, meetings = seen.robot, []
    radii = robot.carrier_radius
    for i, j in combinations(np.flatnonzero(radii).tolist(), 2):
        apart = np.linalg.norm(seen.carriers[:, i, :3] - seen.carriers[:, j, :3], axis=1)
        row, least = int(apart.argmin()), radii[i] + radii[j]
        if apart[row] < least - LEAST:
            names = f"{robot.carriers[i].name} and {robot.carriers[j].name}"
            sentence = f"the centres of {names} are {quantity(apart[row], 'm', 3)} apart at t = {seen.times[row]:.3f} s"
            wide = f", less than the sum of the radii of their bodies, {quantity(least, 'm', 3)}"
            meetings.append((float(least - apart[row]), sentence + wide))
    return _worst(meetings, "limits.carrier_separation: radius keeps them apart")


def _worst(meetings: list[Meeting], mend: str) -> list[str]:
    """Return the sentence of the deepest meeting, with the number of others and what prevents it."""
    if not meetings:
        return []
    others = f" (and {len(meetings) - 1} more)" * (len(meetings) > 1)
    return [f"{max(meetings)[1]}{others}; {mend}"]


def between_points(seen: Instants, limits: Iterable[Limit], limited: Limited) -> list[str]:
    """Return a sentence if a region enters the hull of centre of mass and attachments, all of which stay outside.

    `limited` returns what some of the task's `limits` bound at the instants, (n, k) each.
    """
    robot = seen.robot
    if robot.platform.body is not None:
        return []
    outside = [limit for limit in limits if isinstance(limit, PlatformOutside)]
    kept = [
        (limit, its.min(axis=1))
        for limit, its in zip(outside, limited(outside), strict=True)
        if (its >= limit.low - limit.tolerance).all()
    ]
    if not kept:
        return []
    points = np.vstack([robot.platform.com, robot.attachments])
    try:
        hull = BodyHull(kind="mesh", vertices=tuple(map(tuple, points.tolist())))
    except InputError:  # points of a plane have no hull that bodies could enter
        return []
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    near = np.flatnonzero(np.min([its for _, its in kept], axis=0) < size)
    if not near.size:
        return []
    near = near[:: max(len(near) // MOST, 1)]
    parts = [tuple(body_outside(hull, "", limit.place, limit.called, 0.0)) for limit, _ in kept]
    values = Limits(robot, sum(parts, ())).at_rest(seen.pose[near], seen.carriers[near])
    meetings = []
    for (limit, _), part in zip(kept, parts, strict=True):
        its = np.hstack([values.pop(0) for _ in part]).min(axis=1)
        if its.min() < -ENTERED:
            when, deep = seen.times[near[its.argmin()]], quantity(-its.min(), "m", 3)
            sentence = f"{limit.called!r} passes between the points of the platform: it is {deep} inside the hull of "
            meetings.append((-float(its.min()), f"{sentence}its centre of mass and attachments at t = {when:.3f} s"))
    return _worst(meetings, "a platform.body in the robot's file would keep it out")


class Side(NamedTuple):
    """A side of a robot's frame: the coordinate along `axis` is at most, or for the `sign` -1 at least, `bound` [m]."""

    axis: int
    sign: int
    bound: float
    name: str

    def beyond(self, places: np.ndarray) -> np.ndarray:
        """Return how far places (..., 3) are beyond it [m], negative inside."""
        return self.sign * (places[..., self.axis] - self.bound)


def outside_frame(seen: Instants) -> list[str]:
    """Return a sentence for each side of the robot's frame that the CoM of the platform or an attachment leaves.

    The frame is the box of the anchors during the motion; below, the plane z = 0 of {G} is the floor if gravity
    points down and no anchor is lower. A side beyond which the platform is at home, or for a robot without `home` at
    the start of the motion, does not count: a robot whose {G} lies in the ceiling has no floor, a robot that lifts its
    platform over its anchors no top, and cranes that carry a long beam have no sides along it. Anchors in one vertical
    plane have no sides across it, since a platform may swing there. A robot whose carriers can fly or drive anywhere
    has no frame. Where the robot's file has a floor or a room, limits keep the platform there.
    """
    size = float(np.linalg.norm(np.ptp(seen.anchors, axis=(0, 1))))
    sentences = []
    for side in _sides(seen):
        beyond = side.beyond(seen.platform)
        row, point = np.unravel_index(int(beyond.argmax()), beyond.shape)
        if beyond[row, point] > NEAR * min(size, 1.0):
            part = "its centre of mass" if point == 0 else f"attachment {point}"
            where = quantity_row(np.round(seen.platform[row, point], 4) + 0.0)
            sentences.append(
                f"{LEAVES}: {part} is {quantity(beyond[row, point], 'm', 3)} "
                f"{side.name} at t = {seen.times[row]:.3f} s, at ({where}) m; "
                "limits.platform_box can keep it inside"
            )
    return sentences


def _sides(seen: Instants) -> list[Side]:
    """Return the sides of the frame; none if a carrier that holds a cable can go anywhere."""
    robot = seen.robot
    if robot.workspace_box is not None or not all(robot.carriers[index].confined for index in robot.carrier_of_cable):
        return []
    low, high = seen.anchors.min(axis=(0, 1)), seen.anchors.max(axis=(0, 1))
    spans = high - low
    x, y, z = robot.gravity
    floor = z < 0 and np.hypot(x, y) < 1e-6 * abs(z) and low[2] >= 0
    sides = []
    for axis, name in enumerate(AXES):
        if axis < 2 and spans[axis] <= FLAT * spans.max():
            continue
        for sign, bound, which in ((-1, low[axis], "smallest"), (1, high[axis], "largest")):
            words = f"beyond the anchor with the {which} {name} ({name} = {quantity(bound)} m)"
            if axis == 2 and sign < 0 and robot.floor is not None:
                continue
            if axis == 2 and sign < 0 and floor:
                bound, words = 0.0, "below the floor (z = 0 of {G})"
            elif axis == 2:
                words = f"{'below the lowest' if sign < 0 else 'above the highest'} anchor (z = {quantity(bound)} m)"
            sides.append(Side(axis, sign, float(bound), words))
    usual, held = seen.platform[0], seen.anchors[0]
    if robot.platform.home is not None:
        usual, held = np.vstack([robot.home_com, robot.home_attachments]), robot.home_anchors
    ways = [side.beyond(usual) - (min(side.beyond(held).max(), 0.0) if side.axis < 2 else 0.0) for side in sides]
    return [side for side, beyond in zip(sides, ways, strict=True) if beyond.max() <= NEAR * 1e-3]


def leaves_its_points(path: PathBase) -> list[str]:
    """Return a sentence if a path through waypoints leaves the box of its points."""
    if not isinstance(path, WaypointPath):
        return []
    far = path.outside()
    worst = int(far.argmax())
    if far[worst] < LEFT * np.linalg.norm(np.ptp(np.array(path.points)[:, :3], axis=0)):
        return []
    text = f"the path leaves the box of its points by up to {quantity(far[worst], 'm')} along {'xyz'[worst]}"
    return [f"{text}; the shape legs stays inside"]
