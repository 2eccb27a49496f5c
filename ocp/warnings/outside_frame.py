"""`outside_frame`: where the platform leaves the box of the robot's anchors and the floor."""

from typing import NamedTuple

import numpy as np

from ...base.text import quantity, quantity_row
from ..tasks.paths import PathBase, WaypointPath
from .instants import Instants

LEAST = 1e-3  # [m], and of the size of the frame, whichever is less: nearer than this it is inside
FLAT = 0.1  # of the largest span of the anchors: an axis along which they span less has no sides
AXES = "xyz"
LEFT = 1e-3  # of the span of the points
LEAVES = "the platform leaves the frame of the robot"


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
        if beyond[row, point] > LEAST * min(size, 1.0):
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
    return [side for side, beyond in zip(sides, ways, strict=True) if beyond.max() <= LEAST * 1e-3]


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
