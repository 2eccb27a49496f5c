"""Compute the lines of parts that make a robot recognisable: rotors, sheaves of pulleys, posts."""

import numpy as np

from ..models import Robot
from .geometry import Points

ROUND = np.linspace(0.0, 2 * np.pi, 25)
BLADE = 0.6  # of the arm: radius of a rotor


def rotors(radius: float) -> list[np.ndarray]:
    """Return two crossed arms and four circles that reach to `radius` [m], lines (k, 3) in the frame of a quadrotor."""
    arm = radius / (1 + BLADE)
    ends = arm * np.array([[1, 1, 0], [-1, -1, 0], [1, -1, 0], [-1, 1, 0]]) / np.sqrt(2)
    circle = BLADE * arm * np.stack([np.cos(ROUND), np.sin(ROUND), np.zeros_like(ROUND)], axis=1)
    return [ends[:2], ends[2:], *(end + circle for end in ends)]


def sheaves(robot: Robot, points: Points) -> np.ndarray:
    """Return the circles of the pulleys as line segments (s, 2, 3) in {G} [m], through anchors and exits."""
    found = []
    for index in np.flatnonzero(robot.pulley_radii > 0):
        anchor, leaves = points.anchors[index], points.exits[index]
        along = points.attachments[index] - leaves
        along = along / np.linalg.norm(along)
        inwards = (anchor - leaves) - (anchor - leaves) @ along * along
        if not np.isfinite(inwards).all() or np.linalg.norm(inwards) < 1e-9 * robot.pulley_radii[index]:
            continue  # no cable, or one that leaves at the anchor and has no plane
        radius, inwards = robot.pulley_radii[index], inwards / np.linalg.norm(inwards)
        angles = ROUND[:, None]
        ring = leaves + radius * (inwards + np.cos(angles) * along + np.sin(angles) * inwards)
        found.append(np.stack([ring[:-1], ring[1:]], axis=1))
    return np.concatenate(found) if found else np.zeros((0, 2, 3))


def posts(robot: Robot, floor: float) -> list[np.ndarray]:
    """Return vertical lines (2, 3) in {G} [m] from the anchors of carriers that never move down to the floor."""
    fixed = [not robot.carriers[carrier].moves for carrier in robot.carrier_of_cable]
    anchors = robot.home_anchors[np.array(fixed)]
    return [np.array([anchor, [*anchor[:2], floor]]) for anchor in anchors if anchor[2] > floor]
