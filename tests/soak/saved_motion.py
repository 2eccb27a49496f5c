"""A saved motion at any time, and the points of the robot on it, in NumPy.

Between the saved instants it is the polynomial of degree 5 that has their positions, velocities and accelerations: with
1000 instants a second it is the planned one but for some 1e-12 m.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from towline.models import Robot

SMOOTH = 0.05  # of the jerk: where it changes more from one instant to the next, nothing is interpolated
ROUNDING = 1e-6  # of the largest acceleration

__all__ = ["SavedMotion", "rotation"]


class SavedMotion:
    """The motion at any time, and the points of the robot on it."""

    def __init__(self, robot: Robot, dataset: Any):
        self.robot, self.times = robot, dataset["time"].values
        self._platform = [dataset[name].values for name in ("pose", "velocity", "acceleration")]
        self._carriers = [dataset[f"carrier_{name}"].values for name in ("pose", "velocity", "acceleration")]

    def platform(self, times: np.ndarray) -> Iterator[np.ndarray]:
        """Yield pose, velocity and acceleration, (n, 6) each."""
        return _quintic(self.times, self._platform, times)

    def carriers(self, times: np.ndarray) -> Iterator[np.ndarray]:
        """Yield the same of all carriers, (n, c, 6) each."""
        return _quintic(self.times, self._carriers, times)

    @cached_property
    def smooth(self) -> np.ndarray:
        """Return between which saved instants neither acceleration nor jerk of the platform jumps, (n - 1,)."""
        acceleration = self._platform[2][:, :3]
        change = np.diff(acceleration, axis=0)
        kink = np.abs(np.diff(change, axis=0)).max(axis=1)
        size = np.abs(change).max(axis=1)
        smooth = kink <= SMOOTH * np.minimum(size[1:], size[:-1]) + ROUNDING * np.abs(acceleration).max()
        return np.append(smooth, True) & np.append(True, smooth)

    def looks(self, finer: int) -> np.ndarray:
        """Return the saved instants, and `finer` - 1 others between two of them where neither jumps, (k,) [s]."""
        step = np.diff(self.times)[self.smooth, None]
        between = self.times[:-1][self.smooth, None] + np.arange(1, finer) / finer * step
        return np.sort(np.concatenate([self.times, between.ravel()]))

    def on_platform(self, times: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return points (k, 3) of the platform in {G}, (n, k, 3)."""
        pose = next(self.platform(times))
        return pose[:, None, :3] + points @ rotation(pose[:, 3:]).swapaxes(1, 2)

    def attachments(self, times: np.ndarray) -> np.ndarray:
        """Return the attachments in {G}, (n, m, 3)."""
        return self.on_platform(times, self.robot.attachments)

    def anchors(self, times: np.ndarray) -> np.ndarray:
        """Return the anchors in {G}, (n, m, 3)."""
        pose, owner = next(self.carriers(times)), self.robot.carrier_of_cable
        return pose[:, owner, :3] + np.einsum("nmij,mj->nmi", rotation(pose[..., 3:])[:, owner], self.robot.anchors)

    def cables(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return both ends of all cables."""
        return self.attachments(times), self.anchors(times)


def _quintic(saved: np.ndarray, motion: list[np.ndarray], times: np.ndarray) -> Iterator[np.ndarray]:
    """Yield position, velocity and acceleration at `times` of the polynomials of degree 5 between saved instants."""
    i = np.clip(np.searchsorted(saved, times, side="right") - 1, 0, len(saved) - 2)
    wide = (-1, *[1] * (motion[0].ndim - 1))
    h, s = (saved[i + 1] - saved[i]).reshape(wide), ((times - saved[i]) / (saved[i + 1] - saved[i])).reshape(wide)
    x, v, a = (part[i] for part in motion)
    x_end, v_end, a_end = (part[i + 1] for part in motion)
    c1, c2 = h * v, h**2 * a / 2
    d, e, f = x_end - x - c1 - c2, h * v_end - c1 - 2 * c2, h**2 * a_end - 2 * c2
    c3, c4, c5 = 10 * d - 4 * e + f / 2, -15 * d + 7 * e - f, 6 * d - 3 * e + f / 2
    yield x + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    yield (c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / h
    yield (2 * c2 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))) / h**2


def rotation(angles: np.ndarray) -> np.ndarray:
    """Return Rz(yaw) Ry(pitch) Rx(roll) of angles (..., 3), (..., 3, 3)."""
    (cr, cp, cy), (sr, sp, sy) = np.moveaxis(np.cos(angles), -1, 0), np.moveaxis(np.sin(angles), -1, 0)
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
