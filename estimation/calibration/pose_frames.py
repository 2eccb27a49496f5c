"""`reframed`: poses whose frame, or whose body, lies a little elsewhere than assumed, and `twists_of` these changes.

With small poses F of the frame and B of the platform frame in the body, a pose X becomes F X B. F is about the platform
at home, so that its shift and its turn are hardly correlated.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from ...models import points
from .parameters import FRAMES, OF_ROBOT

Poses = tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray | None]


def reframed(poses: Poses, change: np.ndarray, home: np.ndarray) -> Poses:
    """Return positions (N, 3), rotations (N, 3, 3), velocities and rates (N, 3) or None of changed frames.

    - `change`: shift and rotation vector of F, and of B, (12,) [m, rad].
    - `home`: position that F is about, (3,) [m].
    """
    position, rotation, velocity, rate = poses
    F, B = Rotation.from_rotvec(change[[3, 4, 5]]).as_matrix(), Rotation.from_rotvec(change[[9, 10, 11]]).as_matrix()
    arm = rotation @ change[6:9]
    if velocity is not None and rate is not None:
        velocity, rate = (velocity + np.cross(rate, arm)) @ F.T, rate @ F.T
    return home + change[:3] + (position + arm - home) @ F.T, F @ rotation @ B, velocity, rate


def twists_of(
    poses: Poses, change: np.ndarray, home: np.ndarray, columns: np.ndarray, turned: np.ndarray
) -> np.ndarray:
    """Return shift and rotation in {G} of `reframed` poses by k parameters of the robot, (N, 6, k).

    - `columns`: which of the parameters of the robot, (k,).
    - `turned`: rotations that follow, (N, 3, 3).
    """
    position, rotation, velocity, rate = poses
    result = np.zeros((len(position), 6, OF_ROBOT))
    if velocity is not None and rate is not None:
        result[..., 0] = np.concatenate([velocity, rate], axis=1)
    if (columns >= FRAMES.start).any():
        by_frames = result[..., FRAMES]
        turn, body = (_by_rotation_vector(change[first : first + 3]) for first in (3, 9))
        by_frames[:, :3, :3], by_frames[:, 3:, 3:6] = np.eye(3), turn
        by_frames[:, :3, 3:6] = -points.skew(position - home - change[:3]) @ turn
        before = rotation @ Rotation.from_rotvec(change[9:]).as_matrix().T  # F X, in whose axes B is
        by_frames[:, :3, 6:9], by_frames[:, 3:, 9:] = before, before @ body
        by_frames[:, 3:] = turned @ by_frames[:, 3:]
    return result[..., columns]


def _by_rotation_vector(w: np.ndarray) -> np.ndarray:
    """Return d (small rotation) / d w (3, 3): the mean of exp(s w) over s from 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    turns = Rotation.from_rotvec((1 + nodes[:, None]) / 2 * w).as_matrix()
    return np.einsum("s,sij->ij", weights / 2, turns)
