"""`Reading`: what states of a plant are, in the coordinates of the house."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..robot import Robot
from . import layout

__all__ = ["Reading"]


class Reading:
    """Read states, (..., n): each quantity is computed when it is first used, with the same leading dimensions.

    Parameters
    ----------
    robot
        The robot of the plant.
    states
        (..., n).
    """

    def __init__(self, robot: Robot, states: np.ndarray):
        self._robot, self._states = robot, states

    @cached_property
    def _bodies(self) -> np.ndarray:
        count = 1 + len(self._robot.carriers)
        return self._states[..., : layout.BODY * count].reshape(*self._states.shape[:-1], count, layout.BODY)

    def _cable_block(self, block: int) -> np.ndarray:
        m, places = self._robot.m, layout.BODY * (1 + len(self._robot.carriers))
        return self._states[..., places + block * m : places + (block + 1) * m]

    @cached_property
    def _rotations(self) -> np.ndarray:
        q = self._bodies[..., layout.QUATERNION : layout.VELOCITY]
        w, x, y, z = np.moveaxis(q, -1, 0)
        R = np.empty((*q.shape[:-1], 3, 3))
        R[..., 0, 0], R[..., 0, 1], R[..., 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
        R[..., 1, 0], R[..., 1, 1], R[..., 1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
        R[..., 2, 0], R[..., 2, 1], R[..., 2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
        return R

    @property
    def rotation(self) -> np.ndarray:
        """Return the platform's R, (..., 3, 3) [-]."""
        return self._rotations[..., 0, :, :]

    @property
    def carrier_rotation(self) -> np.ndarray:
        """Return R of the carriers, (..., c, 3, 3) [-]."""
        return self._rotations[..., 1:, :, :]

    @property
    def rate(self) -> np.ndarray:
        """Return the platform's rate in its own axes, (..., 3) [rad/s]."""
        return self._bodies[..., 0, layout.RATE :]

    @property
    def carrier_rate(self) -> np.ndarray:
        """Return the carriers' rates in their own axes, (..., c, 3) [rad/s]."""
        return self._bodies[..., 1:, layout.RATE :]

    @cached_property
    def _motions(self) -> tuple[np.ndarray, np.ndarray]:
        """Return poses and velocities of the frames of all bodies, (..., 1 + c, 6) each."""
        R, bodies = self._rotations, self._bodies
        pose, velocity = np.empty((*bodies.shape[:-1], 6)), np.empty((*bodies.shape[:-1], 6))
        pose[..., :3] = bodies[..., :3]
        velocity[..., :3] = bodies[..., layout.VELOCITY : layout.RATE]
        com, rates = np.array(self._robot.platform.com), bodies[..., layout.RATE :]
        if com.any():
            pose[..., 0, :3] -= R[..., 0, :, :] @ com
            velocity[..., 0, :3] -= np.einsum("...ij,...j->...i", R[..., 0, :, :], np.cross(rates[..., 0, :], com))
        roll = np.arctan2(R[..., 2, 1], R[..., 2, 2])
        sp, cp = -R[..., 2, 0], np.hypot(R[..., 2, 1], R[..., 2, 2])
        pose[..., 3], pose[..., 4] = roll, np.arctan2(sp, cp)
        pose[..., 5] = np.arctan2(R[..., 1, 0], R[..., 0, 0])
        p, q, r = np.moveaxis(rates, -1, 0)
        across = np.sin(roll) * q + np.cos(roll) * r
        with np.errstate(divide="ignore", invalid="ignore"):
            velocity[..., 5] = across / cp
            velocity[..., 3] = p + across * sp / cp
        velocity[..., 4] = np.cos(roll) * q - np.sin(roll) * r
        return pose, velocity

    @property
    def pose(self) -> np.ndarray:
        """Return the pose of the platform frame in {G}, (..., 6) [m, rad]."""
        return self._motions[0][..., 0, :]

    @property
    def velocity(self) -> np.ndarray:
        """Return its time derivative, (..., 6) [m/s, rad/s]; roll and yaw have none at a pitch of 90 degrees."""
        return self._motions[1][..., 0, :]

    @property
    def carrier_pose(self) -> np.ndarray:
        """Return the poses of the carriers in {G}, (..., c, 6) [m, rad]."""
        return self._motions[0][..., 1:, :]

    @property
    def carrier_velocity(self) -> np.ndarray:
        """Return their time derivatives, (..., c, 6) [m/s, rad/s]."""
        return self._motions[1][..., 1:, :]

    @property
    def lengths(self) -> np.ndarray:
        """Return the unstrained lengths, (..., m) [m]; where tensions are commanded, the tensions [N]."""
        return self._cable_block(layout.LENGTH)

    @property
    def length_rates(self) -> np.ndarray:
        """Return the time derivatives of the unstrained lengths, (..., m) [m/s]."""
        return self._cable_block(layout.LENGTH_RATE)
