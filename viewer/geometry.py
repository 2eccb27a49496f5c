"""Compute the points of a robot for many poses at once, and the lines of rotors, sheaves and posts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.errors import InputError
from ..figures.perspective import cell_of
from ..models import Robot
from ..models.dynamics import dynamics_of
from ..models.points import placed
from ..workspace.region import reach_boxes, surrounding_box

FARTHEST = 1e6  # [m] from the origin of {G}: pictures have seven digits
SMALLEST = 1e-6  # [m]
FIELD_OF_VIEW = 0.75  # [rad]
ROUND = np.linspace(0.0, 2 * np.pi, 25)
BLADE = 0.6  # of the arm: radius of a rotor


class Points(NamedTuple):
    """Points of m cables in {G} [m]."""

    anchors: np.ndarray  # (..., m, 3)
    exits: np.ndarray  # where each cable leaves its pulley, (..., m, 3); the anchor if it has none
    attachments: np.ndarray  # (..., m, 3)
    com: np.ndarray  # centre of mass of the platform, (..., 3)


class Extent(NamedTuple):
    """A box along the axes of {G}, from corner to corner (3,) [m]."""

    low: np.ndarray
    high: np.ndarray

    @property
    def size(self) -> float:
        """Return the length of the diagonal [m]."""
        return float(np.linalg.norm(self.high - self.low))

    @property
    def centre(self) -> np.ndarray:
        """Return the centre, where the initial camera looks, (3,) in {G} [m]."""
        return (self.low + self.high) / 2

    @property
    def nearest(self) -> float:
        """Return the distance from the centre at which the box fits into a picture that is wider than high [m]."""
        return float(0.62 * self.size / np.sin(FIELD_OF_VIEW / 2))

    @property
    def cell(self) -> float:
        """Return the edge of the grid's cells [m]: 1, 2 or 5 times a power of ten."""
        return cell_of(self.size)

    @property
    def floor(self) -> float:
        """Return the height of the grid [m], a little below the box, where no platform lies in it."""
        return float(self.low[2] - 0.03 * self.size)

    @staticmethod
    def of(*points: np.ndarray) -> Extent:
        """Return the smallest box around points (..., 3) [m]."""
        every = np.concatenate([some.reshape(-1, 3) for some in points])
        return Extent(every.min(axis=0), every.max(axis=0))


class Geometry:
    """Points of a robot as functions of the poses of its platform and carriers.

    Raises `InputError` if the robot is too large, too small or too far away to be drawn.
    """

    def __init__(self, robot: Robot):
        self.robot = robot
        low, high = surrounding_box(robot, reach_boxes(robot))
        # the smallest box around home, anchors and reach boxes
        self.extent = Extent.of(low, high, robot.home_anchors, robot.home_attachments, robot.carrier_home[:, :3])
        farthest = np.abs([self.extent.low, self.extent.high]).max()
        if not (farthest <= FARTHEST and self.extent.size >= SMALLEST):
            raise InputError(
                f"{robot.name} must have a size of at least {SMALLEST:g} m within {FARTHEST:g} m of the origin to be "
                f"drawn, got {self.extent.size:.4g} m within {farthest:.4g} m"
            )

    def __call__(self, pose: np.ndarray, carrier_pose: np.ndarray) -> Points:
        """Return the points at poses (..., 6) of the platform and (..., c, 6) of the carriers in {G} [m, rad].

        The exit is nan where the attachment is inside the pulley, because then no cable is tangent to it.
        """
        dynamics = dynamics_of(self.robot)
        anchors, attachments = dynamics.points(pose, carrier_pose)
        com = placed(np.asarray(pose, dtype=float), np.array([self.robot.platform.com]))[..., 0, :]
        return Points(anchors, dynamics.exits(pose, carrier_pose), attachments, com)


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
