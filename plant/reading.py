"""`Reading`: read states of a plant in towline's coordinates."""

from functools import cached_property

import numpy as np

from ..core import sense
from ..models import points
from ..models.record import record_of
from ..models.robot import Robot
from . import layout


def sensed(robot: Robot, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what perfect sensors measure of states (..., n).

    The motions (..., 1 + c, 12) are poses and their time derivatives of platform and carriers, as `Reading` has them,
    and the lengths (..., 2, m) distances along the cables and their rates [m, m/s].
    """
    rows, batch = np.ascontiguousarray(states.reshape(-1, states.shape[-1])), states.shape[:-1]
    motions, lengths = np.empty((len(rows), 1 + len(robot.carriers), 12)), np.empty((len(rows), 2, robot.m))
    sense(record_of(robot), rows, motions, lengths)
    return motions.reshape(*batch, *motions.shape[1:]), lengths.reshape(*batch, *lengths.shape[1:])


class Reading:
    """Read states, (..., n). Each quantity is computed on first use, with the same leading dimensions.

    Args:
        robot: The robot of the plant.
        states: (..., n).
    """

    def __init__(self, robot: Robot, states: np.ndarray):
        self._robot, self._states = robot, states

    @cached_property
    def _motions(self) -> np.ndarray:
        return sensed(self._robot, self._states)[0]

    @property
    def _rates(self) -> np.ndarray:
        bodies = self._states[..., : layout.BODY * (1 + len(self._robot.carriers))]
        return bodies.reshape(*bodies.shape[:-1], -1, layout.BODY)[..., layout.RATE :]

    def _cable_block(self, block: int) -> np.ndarray:
        m, places = self._robot.m, layout.BODY * (1 + len(self._robot.carriers))
        return self._states[..., places + block * m : places + (block + 1) * m]

    @property
    def cut(self) -> np.ndarray:
        """Return which cables are cut, (..., m) of bool."""
        return self._cable_block(layout.CONDITION) == layout.CUT

    @property
    def pose(self) -> np.ndarray:
        """Return the pose of the platform frame in {G}, (..., 6) [m, rad]."""
        return self._motions[..., 0, :6]

    @property
    def velocity(self) -> np.ndarray:
        """Return the time derivative of `pose`, (..., 6) [m/s, rad/s]; undefined for angles at 90 degrees of pitch."""
        return self._motions[..., 0, 6:]

    @property
    def rotation(self) -> np.ndarray:
        """Return the rotation matrix of the platform, (..., 3, 3) [-]."""
        return points.rotations(self.pose[..., 3:])

    @property
    def rate(self) -> np.ndarray:
        """Return the angular velocity of the platform in its own axes, (..., 3) [rad/s]."""
        return self._rates[..., 0, :]

    @property
    def carrier_pose(self) -> np.ndarray:
        """Return the poses of the carriers in {G}, (..., c, 6) [m, rad]."""
        return self._motions[..., 1:, :6]

    @property
    def carrier_velocity(self) -> np.ndarray:
        """Return the time derivatives of `carrier_pose`, (..., c, 6) [m/s, rad/s]."""
        return self._motions[..., 1:, 6:]

    @property
    def carrier_rotation(self) -> np.ndarray:
        """Return the rotation matrices of the carriers, (..., c, 3, 3) [-]."""
        return points.rotations(self.carrier_pose[..., 3:])

    @property
    def carrier_rate(self) -> np.ndarray:
        """Return the angular velocities of the carriers in their own axes, (..., c, 3) [rad/s]."""
        return self._rates[..., 1:, :]

    @property
    def lengths(self) -> np.ndarray:
        """Return the unstrained lengths, (..., m) [m], or the tensions [N] if tensions are commanded."""
        return self._cable_block(layout.LENGTH)

    @property
    def length_rates(self) -> np.ndarray:
        """Return the time derivatives of the unstrained lengths, (..., m) [m/s]."""
        return self._cable_block(layout.LENGTH_RATE)
