"""Position of a platform on three cables with given attitude and cable lengths."""

import numpy as np

from ..models import Robot
from ..models.points import anchors, attachments


def three_cable_pose(robot: Robot, attitude: np.ndarray, carriers: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return positions of a platform on three cables of given lengths at given attitudes.

    |A_i - P - R b_i| = l_i: P lies on spheres about A_i - R b_i with the radii l_i. Of the two points that three
    spheres share it is the lower, along gravity.

    - `robot`: robot with three cables whose anchors are points.
    - `attitude`: (roll, pitch, yaw) of the platform, (n, 3) [rad].
    - `carriers`: poses in {G}, (n, c, 6) [m, rad].
    - `lengths`: (3,) for all configurations or (n, 3) [m].

    Returns positions in {G}, (n, 3) [m]; nan where the cables do not meet.
    """
    turned = np.concatenate([np.zeros_like(attitude), attitude], axis=1)
    centres = anchors(robot, carriers) - attachments(robot, turned)  # (n, 3, 3)
    to_second, to_third = centres[:, 1] - centres[:, 0], centres[:, 2] - centres[:, 0]
    squares = np.broadcast_to(lengths, (len(attitude), 3)) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = np.cross(to_second, to_third)
        area = _square(normal)
        # In the plane of the centres: 2 a . p = l_1^2 - l_2^2 + |a|^2, and so for b.
        along_second = squares[:, :1] - squares[:, 1:2] + _square(to_second)
        along_third = squares[:, :1] - squares[:, 2:] + _square(to_third)
        foot = np.cross(normal, along_third * to_second - along_second * to_third) / (2.0 * area)
        drop = normal * np.sqrt((squares[:, :1] - _square(foot)) / area)
        drop *= np.where(drop @ np.array(robot.gravity) < 0, -1.0, 1.0)[:, None]
        return centres[:, 0] + foot + drop


def _square(vectors: np.ndarray) -> np.ndarray:
    """Return squared lengths, (n, 1)."""
    return np.einsum("ni,ni->n", vectors, vectors)[:, None]
