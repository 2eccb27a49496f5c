"""`CarrierMotion`: measured poses of carriers over time, shifted by the clock offset of all measured poses."""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

import numpy as np

from ...models import points
from ...models.robot import Robot
from ..logs.measurements import Measurements
from ..logs.pose_track import PoseTrack


class Carriers(NamedTuple):
    """Poses (N, c, 6) [m, rad], velocities (N, c, 3) [m/s] and rates (N, c, 3) [rad/s] in {G}."""

    poses: np.ndarray
    velocities: np.ndarray
    rates: np.ndarray

    def of_cables(self, robot: Robot, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the velocities of attachments (m, N, 3) as points of each cable's carrier, and its rates, (m, N, 3).

        Moving the carrier changes a cable as moving its attachment the opposite way does, and turns both.
        """
        owner = robot.carrier_of_cable
        place, velocity, rate = (
            np.swapaxes(part[:, owner], 0, 1) for part in (self.poses[..., :3], self.velocities, self.rates)
        )
        return velocity + np.cross(rate, ends - place), rate


class CarrierMotion:
    """The motion of carriers by their measured poses at the times of a log."""

    def __init__(self, robot: Robot, measurements: Measurements):
        assert measurements.times is not None
        assert measurements.carrier_poses is not None
        poses, all_ = measurements.carrier_poses, np.ones(len(measurements), dtype=bool)
        self._tracks = [
            PoseTrack(measurements.times, poses[:, i, :3], points.rotations(poses[:, i, 3:]), all_)
            for i in range(len(robot.carriers))
        ]

    def at_samples(self, rows: np.ndarray | slice) -> CarrierMotion:
        """Return the same motion at the times of some samples (k,)."""
        other = copy(self)
        other._tracks = [track.at_samples(rows) for track in self._tracks]
        return other

    def at(self, clock: float) -> Carriers:
        """Return the motion `clock` [s] later."""
        position, rotation, velocity, rate = (
            np.stack(part, axis=1) for part in zip(*(track.at(clock) for track in self._tracks), strict=True)
        )
        return Carriers(np.concatenate([position, points.angles(rotation)], axis=2), velocity, rate)
