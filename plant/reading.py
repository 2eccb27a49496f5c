"""`Reading`: read states of a plant in towline's coordinates."""

from functools import cached_property

import numpy as np

from ..models import points
from ..models.robot import Robot
from . import layout


def _rotation_of_products() -> np.ndarray:
    """Return the map from products of two entries of a unit quaternion (w, x, y, z) to the entries of R, (16, 9)."""
    of = np.zeros((4, 4, 3, 3))
    of[0, 0] = np.eye(3)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        of[1 + i, 1 + i, [0, 1, 2], [0, 1, 2]] = -1.0
        of[1 + i, 1 + i, i, i] = 1.0
        of[1 + i, 1 + j, [i, j], [j, i]] = 2.0
        of[0, 1 + i, k, j], of[0, 1 + i, j, k] = 2.0, -2.0
    return of.reshape(16, 9)


_ROTATION = _rotation_of_products()


class _Bodies:
    """The motion of bodies, (..., 13) in a state, with the position of their CoM in their frame, (3,)."""

    def __init__(self, blocks: np.ndarray, com: np.ndarray):
        self._blocks, self._com = blocks, com

    @property
    def rate(self) -> np.ndarray:
        return self._blocks[..., layout.RATE :]

    @cached_property
    def rotation(self) -> np.ndarray:
        q = self._blocks[..., layout.QUATERNION : layout.VELOCITY]
        products = (q[..., :, None] * q[..., None, :]).reshape(*q.shape[:-1], 16)
        return (products @ _ROTATION).reshape(*q.shape[:-1], 3, 3)

    @cached_property
    def pose(self) -> np.ndarray:
        R, pose = self.rotation, np.empty((*self._blocks.shape[:-1], 6))
        pose[..., :3] = self._blocks[..., :3]
        if self._com.any():
            pose[..., :3] -= R @ self._com
        pose[..., 3:] = points.angles(R)
        return pose

    @cached_property
    def velocity(self) -> np.ndarray:
        R, velocity = self.rotation, np.empty((*self._blocks.shape[:-1], 6))
        velocity[..., :3] = self._blocks[..., layout.VELOCITY : layout.RATE]
        if self._com.any():
            velocity[..., :3] -= np.einsum("...ij,...j->...i", R, np.cross(self.rate, self._com))
        sine, cosine = -R[..., 2, 0], np.hypot(R[..., 2, 1], R[..., 2, 2])  # of the pitch
        p, q, r = self.rate[..., 0], self.rate[..., 1], self.rate[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            roll_sine, roll_cosine = R[..., 2, 1] / cosine, R[..., 2, 2] / cosine
            velocity[..., 5] = (roll_sine * q + roll_cosine * r) / cosine
            velocity[..., 3] = p + velocity[..., 5] * sine
            velocity[..., 4] = roll_cosine * q - roll_sine * r
        return velocity


class Reading:
    """Read states, (..., n). Each quantity is computed on first use, with the same leading dimensions.

    Args:
        robot: The robot of the plant.
        states: (..., n).
    """

    def __init__(self, robot: Robot, states: np.ndarray):
        self._robot, self._states = robot, states
        self._count = 1 + len(robot.carriers)

    def _of(self, first: int, count: int) -> np.ndarray:
        blocks = self._states[..., layout.BODY * first : layout.BODY * (first + count)]
        return blocks.reshape(*self._states.shape[:-1], count, layout.BODY)

    @cached_property
    def _platform(self) -> _Bodies:
        return _Bodies(self._of(0, 1)[..., 0, :], np.array(self._robot.platform.com))

    @cached_property
    def _carriers(self) -> _Bodies:
        return _Bodies(self._of(1, self._count - 1), np.zeros(3))

    def _cable_block(self, block: int) -> np.ndarray:
        m, places = self._robot.m, layout.BODY * self._count
        return self._states[..., places + block * m : places + (block + 1) * m]

    @property
    def cut(self) -> np.ndarray:
        """Return which cables are cut, (..., m) of bool."""
        return self._cable_block(layout.CONDITION) == layout.CUT

    @property
    def pose(self) -> np.ndarray:
        """Return the pose of the platform frame in {G}, (..., 6) [m, rad]."""
        return self._platform.pose

    @property
    def velocity(self) -> np.ndarray:
        """Return the time derivative of `pose`, (..., 6) [m/s, rad/s]; undefined for angles at 90 degrees of pitch."""
        return self._platform.velocity

    @property
    def rotation(self) -> np.ndarray:
        """Return the rotation matrix of the platform, (..., 3, 3) [-]."""
        return self._platform.rotation

    @property
    def rate(self) -> np.ndarray:
        """Return the angular velocity of the platform in its own axes, (..., 3) [rad/s]."""
        return self._platform.rate

    @property
    def carrier_pose(self) -> np.ndarray:
        """Return the poses of the carriers in {G}, (..., c, 6) [m, rad]."""
        return self._carriers.pose

    @property
    def carrier_velocity(self) -> np.ndarray:
        """Return the time derivatives of `carrier_pose`, (..., c, 6) [m/s, rad/s]."""
        return self._carriers.velocity

    @property
    def carrier_rotation(self) -> np.ndarray:
        """Return the rotation matrices of the carriers, (..., c, 3, 3) [-]."""
        return self._carriers.rotation

    @property
    def carrier_rate(self) -> np.ndarray:
        """Return the angular velocities of the carriers in their own axes, (..., c, 3) [rad/s]."""
        return self._carriers.rate

    @property
    def lengths(self) -> np.ndarray:
        """Return the unstrained lengths, (..., m) [m], or the tensions [N] if tensions are commanded."""
        return self._cable_block(layout.LENGTH)

    @property
    def length_rates(self) -> np.ndarray:
        """Return the time derivatives of the unstrained lengths, (..., m) [m/s]."""
        return self._cable_block(layout.LENGTH_RATE)
