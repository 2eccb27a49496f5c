"""`Attitudes`: turn from one attitude to the next by the smallest angle, in Euler angles with exact derivatives.

Between attitudes R_k and R_k+1 the rotation vector is w_k = log(R_k^T R_k+1). Where two successive turns overlap, with
shares a and b done, R = R_k exp(a w_k) exp(b w_k+1), with the body rate and its derivative

    Omega  = E^T w_k a' + w_k+1 b',    E = exp(b w_k+1),
    Omega' = E^T w_k a'' - b' w_k+1 x (E^T w_k a') + w_k+1 b'',

from which Euler rates follow by the rate matrix (`models.rotation`).
"""

from functools import cache

import casadi as ca
import numpy as np

from ....models.batch import call
from ....models.rotation import angles_of, inverse_rate_matrix, rate_matrix_derivative, rotation
from .base import Motion

Progress = tuple[np.ndarray, np.ndarray, np.ndarray]
HALF_TURN = 1e-9  # of the real part of a quaternion: both ways are equally short, and the angles decide
SAME = 1e-12  # [rad]


class Attitudes:
    """Attitudes in order, and the shortest turns between them.

    `angles`: (n, 3), (roll, pitch, yaw) [rad].
    """

    def __init__(self, angles: np.ndarray):
        self._angles = angles
        self._quaternions = _quaternions(angles)
        self._axes, self._turns = _turns(self._quaternions[:-1], self._quaternions[1:])
        self._padded = np.vstack([self._axes, np.zeros(3)]), np.append(self._turns, 0.0)  # of none after the last

    @property
    def steps(self) -> np.ndarray:
        """Return the rotation vectors from each attitude to the next, in the axes of the first, (n - 1, 3) [rad]."""
        return self._axes * self._turns[:, None]

    @property
    def from_first(self) -> np.ndarray:
        """Return the rotation vectors from the first attitude to each, (n, 3) [rad]."""
        axes, turns = _turns(self._quaternions[:1], self._quaternions)
        return axes * turns[:, None]

    @property
    def constant(self) -> bool:
        """Return whether all attitudes are the same."""
        return not self._turns.any()

    def along(self, leg: np.ndarray, first: Progress, second: Progress) -> Motion:
        """Return (roll, pitch, yaw) and two derivatives, (n, 3) each; angles lie within one turn.

        `first` and `second` are the shares done of turn `leg` and of the next one, with two derivatives.
        """
        if self.constant:
            still = np.zeros((len(leg), 3))
            return Motion(still + self._angles[0], still, still)
        axes, turns = self._padded
        arguments = {"start": self._angles[leg]}
        for name, k, progress in (("first", leg, first), ("second", leg + 1, second)):
            arguments[f"{name}_axis"] = axes[k]
            arguments[f"{name}_turn"] = np.stack(progress, axis=1) * turns[k, None]
        result = call(_turning(), arguments)
        return Motion(result["angles"], result["rates"], result["accelerations"])


def nearest_turn(angles: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Return angles with full turns added, so that they lie nearest to others [rad]."""
    return angles + 2 * np.pi * np.round((near - angles) / (2 * np.pi))


@cache
def _turning() -> ca.Function:
    """Return the function of an attitude and two turns in progress to Euler angles and their derivatives."""
    start = ca.SX.sym("start", 3)
    first_axis, second_axis = ca.SX.sym("first_axis", 3), ca.SX.sym("second_axis", 3)
    first, second = ca.SX.sym("first", 3), ca.SX.sym("second", 3)
    then = _exponential(second_axis, second[0])
    angles = angles_of(rotation(start) @ _exponential(first_axis, first[0]) @ then)
    axis = then.T @ first_axis
    rate = axis * first[1] + second_axis * second[1]
    rate_rate = axis * first[2] - second[1] * ca.cross(second_axis, axis) * first[1] + second_axis * second[2]
    inverse = inverse_rate_matrix(angles)
    rates = inverse @ rate
    accelerations = inverse @ (rate_rate - rate_matrix_derivative(angles, rates) @ rates)
    names = ["start", "first_axis", "first_turn", "second_axis", "second_turn"]
    inputs = [start, first_axis, first, second_axis, second]
    outputs = ["angles", "rates", "accelerations"]
    return ca.Function("turning", inputs, [angles, rates, accelerations], names, outputs)


def _exponential(axis: ca.SX, angle: ca.SX) -> ca.SX:
    """Return the rotation by an angle about a unit axis, (3, 3) (Rodrigues)."""
    skew = ca.skew(axis)
    return ca.SX.eye(3) + ca.sin(angle) * skew + (1 - ca.cos(angle)) * (skew @ skew)


def _turns(before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return axes (n, 3) and angles (n,) [rad] of the shortest turns between attitudes, as quaternions (n, 4)."""
    # The product of the first one's conjugate and the second.
    real, vector = np.sum(before * after, axis=1), before[:, :1] * after[:, 1:] - after[:, :1] * before[:, 1:]
    vector = vector - np.cross(before[:, 1:], after[:, 1:])
    back = np.where(real < -HALF_TURN, -1.0, 1.0)
    sine = np.linalg.norm(vector, axis=1)
    angle = 2 * np.arctan2(sine, back * real)
    return vector * (back / np.where(sine > 0, sine, 1.0))[:, None], np.where(angle > SAME, angle, 0.0)


def _quaternions(angles: np.ndarray) -> np.ndarray:
    """Return the unit quaternions (w, x, y, z) of Rz(yaw) Ry(pitch) Rx(roll), (n, 4)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles / 2).T, np.sin(angles / 2).T
    w, x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    y, z = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
    return np.stack([w, x, y, z], axis=1)
