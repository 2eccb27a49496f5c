"""Where the parts of a robot are: `Geometry`, by the same kinematics as its wrench matrix, for many poses at once."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np

from ..models import Robot, kinematics
from ..models.batch import call
from ..workspace.region import reach_boxes, surrounding_box


class Points(NamedTuple):
    """Points of m cables in {G} [m].

    Attributes
    ----------
    anchors, attachments
        (..., m, 3).
    exits
        Where each cable leaves its pulley, (..., m, 3); the anchor if it has none.
    com
        Of the platform, (..., 3).
    """

    anchors: np.ndarray
    exits: np.ndarray
    attachments: np.ndarray
    com: np.ndarray


class Room(NamedTuple):
    """A box along the axes of {G}, from corner to corner (3,) [m]."""

    low: np.ndarray
    high: np.ndarray

    @property
    def size(self) -> float:
        """Its diagonal [m]."""
        return float(np.linalg.norm(self.high - self.low))

    @staticmethod
    def of(*points: np.ndarray) -> Room:
        """The smallest one around points (..., 3) [m]."""
        every = np.concatenate([some.reshape(-1, 3) for some in points])
        return Room(every.min(axis=0), every.max(axis=0))


class Geometry:
    """Points of a robot as functions of the poses of its platform and carriers.

    Attributes
    ----------
    room
        That home, anchors and reach boxes take up.
    """

    def __init__(self, robot: Robot):
        self.robot = robot
        low, high = surrounding_box(robot, reach_boxes(robot))
        self.room = Room.of(low, high, robot.home_anchors, robot.home_attachments, robot.carrier_home[:, :3])
        pose, carriers = ca.SX.sym("pose", 6), ca.SX.sym("carrier_pose", len(robot.carriers), 6)
        anchors = kinematics.anchors(robot.anchors, robot.carrier_of_cable, carriers)
        axes = kinematics.axes(robot.pulley_axes, robot.carrier_of_cable, carriers)
        exits = kinematics.cables(robot.attachments, pose, anchors, axes, robot.pulley_radii).points
        outputs = {
            "anchors": anchors.T,
            "exits": exits.T,
            "attachments": kinematics.transform(pose, robot.attachments).T,
            "com": kinematics.transform(pose, np.array([robot.platform.com])),
        }
        self._function = ca.Function(
            "points", [pose, carriers], list(outputs.values()), ["pose", "carrier_pose"], list(outputs)
        )

    def __call__(self, pose: np.ndarray, carrier_pose: np.ndarray) -> Points:
        """The points at poses (..., 6) of the platform and (..., c, 6) of the carriers in {G} [m, rad].

        Inside a sheave no cable is tangent to it: its exit is nan there.
        """
        return Points(**call(self._function, {"pose": pose, "carrier_pose": carrier_pose}))
