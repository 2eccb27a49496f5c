"""Where the points of a robot are, for many poses at once, in NumPy alone.

`kinematics` has the same for CasADi expressions, and the numeric core for a robot's record. A robot is checked at home,
and its record filled, with what is here, so that it can use neither; and robots are of any type here, not `Robot`.
"""

from typing import Any

import numpy as np

NEARLY_SYMMETRIC = 1e-6  # sine of the angle of a rotation


def rotations(angles: np.ndarray) -> np.ndarray:
    """Return R = Rz(yaw) Ry(pitch) Rx(roll) of angles (..., 3) [rad], (..., 3, 3) [-]."""
    (sr, sp, sy), (cr, cp, cy) = ([part[..., k] for k in range(3)] for part in (np.sin(angles), np.cos(angles)))
    R = np.empty((*angles.shape[:-1], 3, 3))
    R[..., 0, 0], R[..., 0, 1], R[..., 0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    R[..., 1, 0], R[..., 1, 1], R[..., 1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    R[..., 2, 0], R[..., 2, 1], R[..., 2, 2] = -sp, cp * sr, cp * cr
    return R


def angles(R: np.ndarray) -> np.ndarray:
    """Return (roll, pitch, yaw) of rotations (..., 3, 3), (..., 3) [rad]: pitch within a quarter turn."""
    upright = np.hypot(R[..., 2, 1], R[..., 2, 2])
    roll, pitch = np.arctan2(R[..., 2, 1], R[..., 2, 2]), np.arctan2(-R[..., 2, 0], upright)
    # The yaw that belongs to this roll: at a pitch of 90 degrees both are rounding, and only together an attitude.
    sine, cosine = np.sin(roll), np.cos(roll)
    across, along = sine * R[..., 0, 2] - cosine * R[..., 0, 1], cosine * R[..., 1, 1] - sine * R[..., 1, 2]
    return np.stack([roll, pitch, np.arctan2(across, along)], axis=-1)


def shortest_way(off: np.ndarray) -> np.ndarray:
    """Return differences of poses (..., 6) [m, rad] without whole turns: their angles are within half a turn."""
    position, turned = off[..., :3], off[..., 3:]
    return np.concatenate([position, turned - 2 * np.pi * np.round(turned / (2 * np.pi))], axis=-1)


def axial(matrices: np.ndarray) -> np.ndarray:
    """Return the vectors (..., 3) of the skew-symmetric parts of matrices (..., 3, 3)."""
    skew = (matrices - matrices.swapaxes(-1, -2)) / 2
    return np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)


def rotation_vectors(R: np.ndarray) -> np.ndarray:
    """Return the rotation vectors (N, 3) [rad] of rotations (N, 3, 3).

    Fits of long logs need them at every step: this takes an eighth of the time of SciPy's `Rotation`, and differs from
    it by up to 1e-9 near half turns.
    """
    sines, cosines = axial(R), (np.trace(R, axis1=1, axis2=2) - 1) / 2
    sizes = np.linalg.norm(sines, axis=1)
    turned = np.arctan2(sizes, cosines)
    result = sines * np.divide(turned, sizes, out=np.ones_like(sizes), where=sizes > 0)[:, None]
    for k in np.flatnonzero((sizes < NEARLY_SYMMETRIC) & (cosines < 0)):  # half turns, which hide the axis there
        products = (R[k] + R[k].T) / 2 - cosines[k] * np.eye(3)  # of the axis with itself, times 1 - cosine
        axis = products[np.argmax(np.diag(products))]
        result[k] = turned[k] * axis / np.linalg.norm(axis) * (-1.0 if axis @ sines[k] < 0 else 1.0)
    return result


def skew(vectors: np.ndarray) -> np.ndarray:
    """Return the matrices (..., 3, 3) whose product with v is the cross product of vectors (..., 3) and v."""
    result = np.zeros((*vectors.shape, 3))
    result[..., [2, 0, 1], [1, 2, 0]], result[..., [1, 2, 0], [2, 0, 1]] = vectors, -vectors
    return result


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross products of vectors (..., 3), as `numpy.cross` does, in about 0.6 of its time."""
    before, after = [2, 0, 1], [1, 2, 0]
    return a[..., after] * b[..., before] - a[..., before] * b[..., after]


def placed(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Place points (k, 3) of the frame at `pose` (..., 6) into {G}: x + R p, (..., k, 3) [m]."""
    turned = np.einsum("...ij,kj->...ki", rotations(pose[..., 3:]), points)
    return pose[..., None, :3] + turned


def in_frame(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points (..., 3) of {G}, one for each `pose` (..., 6), in the frame at that pose, (..., 3) [m]."""
    return np.einsum("...ij,...i->...j", rotations(pose[..., 3:]), points - pose[..., :3])


def moved(pose: np.ndarray, step: np.ndarray, point: Any = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Return poses moved by displacements of a `point` of the platform and rotation vectors in {G}, (..., 6) each."""
    from scipy.spatial.transform import Rotation

    pose, step = np.broadcast_arrays(pose, step)
    R = rotations(pose[..., 3:])
    turned = Rotation.from_rotvec(np.array(step[..., 3:]).reshape(-1, 3)).as_matrix().reshape(R.shape) @ R
    return np.concatenate([pose[..., :3] + step[..., :3] + (R - turned) @ np.array(point), angles(turned)], axis=-1)


def anchors(robot: Any, carrier_pose: np.ndarray) -> np.ndarray:
    """Place the anchors of a robot into {G}, with its carriers at `carrier_pose` (..., c, 6), (..., m, 3) [m]."""
    owner, points = robot.carrier_of_cable, robot.anchors
    if not points.any():
        return carrier_pose[..., owner, :3]
    result = np.empty((*carrier_pose.shape[:-2], *points.shape))
    for carrier in range(carrier_pose.shape[-2]):
        cables = np.flatnonzero(owner == carrier)
        result[..., cables, :] = placed(carrier_pose[..., carrier, :], points[cables])
    return result


def attachments(robot: Any, pose: np.ndarray) -> np.ndarray:
    """Place the attachments of a robot into {G}, with its platform at `pose` (..., 6), (..., m, 3) [m]."""
    return placed(pose, robot.attachments)


def default_home(anchor_points: np.ndarray, attachment_points: np.ndarray) -> np.ndarray:
    """Return a home pose in {G}, (6,) [m, rad]: level, amid the anchors, or below them if the platform hangs.

    The platform is treated as suspended if the heights of its anchors differ by less than a tenth of their horizontal
    spread. Then it is placed as far below their centre as they are wide.

    - `anchor_points`: in {G}, (m, 3) [m].
    - `attachment_points`: in the platform frame, (m, 3) [m].
    """
    centre = anchor_points.mean(axis=0)
    spread = np.linalg.norm(anchor_points[:, :2] - centre[:2], axis=1).max()
    reach = max(spread, np.linalg.norm(attachment_points, axis=1).max(), 1e-3)
    if np.ptp(anchor_points[:, 2]) < 0.1 * reach:
        centre[2] -= reach
    return np.concatenate([centre, np.zeros(3)])
