"""`CarrierClocks`: a log in which another computer recorded the carriers, whose clocks are known only roughly.

`sigma.clocks` of the measurements is the standard deviation of these clocks, relative to the platform's. All
that a carrier recorded, which is its motion and the tensions and directions of its cables, is moved in time together.
"""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from ...models import points
from ...models.robot import Robot
from ..logs.measurements import Measurements
from ..logs.smoothing import continuous, smooth, within
from .balance import Balance
from .carrier_motion import CarrierMotion
from .model import Model

FEWEST = 8  # samples


def has_carrier_clocks(robot: Robot, measurements: Measurements) -> bool:
    """Return whether the measurements contain motions of carriers whose clocks are not known exactly."""
    moves = measurements.carrier_poses is not None and any(carrier.moves for carrier in robot.carriers)
    return bool(moves and measurements.times is not None and measurements.sigma.clocks and len(measurements) >= FEWEST)


class CarrierClocks:
    """Measurements as recorded, from which poses of moving carriers can be read at shifted times (`Recorded`)."""

    unit, per_second = "s", 1.0

    def __init__(self, robot: Robot, given: Measurements):
        times, poses = given.times, given.carrier_poses
        assert times is not None
        assert poses is not None
        self._carriers = np.flatnonzero([carrier.moves for carrier in robot.carriers])
        self.names = tuple(f"{robot.carriers[i].name}.clock" for i in self._carriers)
        self.sigmas = np.full(len(self._carriers), given.sigma.clocks)
        self._robot, self._given, self._times, neighbours = robot, given, times, within(times)
        self._parts: list[tuple[np.ndarray, np.ndarray, np.ndarray, CubicSpline]] = []
        for index in self._carriers:
            own = np.asarray(robot.carrier_of_cable) == index
            turned = continuous(Rotation.from_matrix(points.rotations(poses[:, index, 3:])).as_quat())
            whole = np.hstack(
                [poses[:, index, :3], turned, *(part[:, own].reshape(len(times), -1) for part in self._of)]
            )
            curve = CubicSpline(times, smooth(times, _bridged(times, whole), neighbours))
            self._parts.append((own, whole, curve(times), curve))

    @property
    def _of(self) -> list[np.ndarray]:
        """Return the tensions and directions of the cables, which are shifted with the carriers; nan if unknown."""
        return [part for part in (self._given.tensions, self._given.directions) if part is not None]

    def at(self, ahead: np.ndarray) -> Measurements:
        """Return the measurements on one clock, if the clocks of the carriers are `ahead` of it, (k,) [s]."""
        given, new = self._given, [part.copy() for part in self._of]
        assert given.carrier_poses is not None
        poses = given.carrier_poses.copy()
        for index, by, (own, whole, smoothed, curve) in zip(self._carriers, ahead, self._parts, strict=True):
            # The noise is not shifted: interpolated noise is smaller, so that shifts of half a sample would fit better.
            later = whole + curve(self._times + by) - smoothed
            poses[:, index, :3] = later[:, :3]
            poses[:, index, 3:] = points.angles(Rotation.from_quat(later[:, 3:7]).as_matrix())
            first = 7
            for part in new:
                size = part[0, own].size
                part[:, own] = later[:, first : first + size].reshape(len(part), *part[0, own].shape)
                first += size
        named = {("tensions" if part.ndim == 2 else "directions"): part for part in new}
        return given.changed(carrier_poses=poses, **named, sigma={**given.sigma._asdict(), "clocks": 0.0})

    def model(self, model: Model, ahead: np.ndarray) -> Model:
        """Return a model with these measurements."""
        measurements = self.at(ahead)
        motion = None if model.carriers is None else CarrierMotion(self._robot, measurements)
        forces = Balance(self._robot, measurements)
        return replace(model, measurements=measurements, forces=forces, carriers=motion)


def _bridged(times: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return columns (n, k) with linear interpolations in place of nan, and zeros in columns without a number."""
    known = np.isfinite(columns)
    bridged = [
        np.interp(times, times[at], column[at]) if at.any() else np.zeros(len(times))
        for column, at in zip(columns.T, known.T, strict=True)
    ]
    return np.stack(bridged, axis=1)
