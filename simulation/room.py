"""`Room`: floor and walls of a robot, which the plant does not have, and how far a platform is beyond them."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..models.body import skeleton
from ..models.points import placed
from ..models.robot import Robot

LEAST = 1e-3  # [m]: nearer than this a platform is inside
UPRIGHT = 1e-6  # of gravity, across z


class Room(NamedTuple):
    """Bounds in {G} of points of the platform's frame."""

    points: np.ndarray  # (k, 3) [m]
    bounds: np.ndarray  # least and largest coordinates, of points that have their radius as distance, (2, 3) [m]
    names: tuple[str, ...]  # of the sides in the order of bounds, (6,)
    is_known: bool  # whether the robot's file has them; otherwise the floor is where it usually is

    def beyond(self, poses: np.ndarray) -> np.ndarray:
        """Return how far the platform is beyond each side at poses (n, 6), (n, 6) [m]; negative inside."""
        least, most = (reduce(placed(poses, self.points), axis=1) for reduce in (np.min, np.max))
        return np.concatenate([self.bounds[0] - least, most - self.bounds[1]], axis=1)


@lru_cache(maxsize=16)
def room_of(robot: Robot) -> Room | None:
    """Return floor and walls of a robot; None if it has none, nor a usual floor.

    The usual floor is the plane z = 0 of {G}, if gravity points down and neither an anchor nor the platform at home is
    lower.
    """
    body, box = robot.platform.body, robot.workspace_box
    points, radius = np.vstack([robot.platform.com, robot.attachments]), 0.0
    if body is not None:
        points, radius = skeleton(body).corners, body.rounding
    bounds = np.array([[-np.inf] * 3, [np.inf] * 3] if box is None else [box.min, box.max])
    names = [f"beyond the {side} {axis} of the room" for side in ("smallest", "largest") for axis in "xyz"]
    is_known = box is not None or robot.floor is not None
    if not is_known:
        x, y, z = robot.gravity
        lowest = min(robot.home_anchors[:, 2].min(), placed(robot.home, points)[:, 2].min() - radius)
        if z >= 0 or np.hypot(x, y) > -UPRIGHT * z or lowest < 0:
            return None
        bounds[0, 2], names[2] = 0.0, "below z = 0 of {G}, where the floor usually is"
    elif robot.floor is not None and robot.floor >= bounds[0, 2]:
        bounds[0, 2], names[2] = robot.floor, "below the floor"
    return Room(points, bounds + np.array([[radius], [-radius]]), tuple(names), is_known)
