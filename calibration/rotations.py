"""Rotations in bulk, in NumPy: matrices from rotation vectors and quaternions, and back; small turns are in {G}."""

from __future__ import annotations

import numpy as np

__all__ = ["angles_of", "cross_matrices", "from_quaternions", "from_vectors", "quaternions_of", "vectors_of"]

SMALL = 1e-6  # [rad]: below it the series of sine and cosine are exact to rounding


def cross_matrices(vectors: np.ndarray) -> np.ndarray:
    """Return the matrices of v x, (..., 3, 3), of vectors (..., 3)."""
    result = np.zeros((*vectors.shape, 3))
    x, y, z = np.moveaxis(vectors, -1, 0)
    result[..., 0, 1], result[..., 0, 2] = -z, y
    result[..., 1, 0], result[..., 1, 2] = z, -x
    result[..., 2, 0], result[..., 2, 1] = -y, x
    return result


def from_vectors(vectors: np.ndarray) -> np.ndarray:
    """Return the rotations about axes by angles, both as vectors (..., 3) [rad], (..., 3, 3) [-]."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    small = angle < SMALL
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 1.0, np.sin(safe) / safe)
    second = np.where(small, 0.5, (1 - np.cos(safe)) / safe**2)
    K = cross_matrices(vectors)
    return np.eye(3) + first * K + second * (K @ K)


def vectors_of(R: np.ndarray) -> np.ndarray:
    """Return the rotation vectors [rad], (..., 3), of rotations (..., 3, 3), of angles up to half a turn."""
    quaternions = quaternions_of(R)
    quaternions = quaternions * np.where(quaternions[..., 3:] < 0, -1.0, 1.0)
    sine = np.linalg.norm(quaternions[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, quaternions[..., 3:])
    return quaternions[..., :3] * np.where(sine < SMALL, 2.0, angle / np.where(sine < SMALL, 1.0, sine))


def from_quaternions(quaternions: np.ndarray) -> np.ndarray:
    """Return the rotations (..., 3, 3) of quaternions (x, y, z, w), (..., 4), of any length above zero."""
    x, y, z, w = np.moveaxis(quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def quaternions_of(R: np.ndarray) -> np.ndarray:
    """Return the quaternions (x, y, z, w), (..., 4), of rotations (..., 3, 3); of either sign.

    Of the four ways to compute them, that without cancellation is taken, as by Shepperd (1978).
    """
    xx, yy, zz = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    squares = np.stack([1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz], axis=-1)
    xy, xz, yz = R[..., 0, 1] + R[..., 1, 0], R[..., 0, 2] + R[..., 2, 0], R[..., 1, 2] + R[..., 2, 1]
    wx, wy, wz = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    products = np.stack(
        [
            np.stack([squares[..., 0], xy, xz, wx], axis=-1),
            np.stack([xy, squares[..., 1], yz, wy], axis=-1),
            np.stack([xz, yz, squares[..., 2], wz], axis=-1),
            np.stack([wx, wy, wz, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    largest = np.argmax(squares, axis=-1)[..., None, None]
    row = np.take_along_axis(products, largest, axis=-2)[..., 0, :]
    return row / np.linalg.norm(row, axis=-1, keepdims=True)


def angles_of(R: np.ndarray) -> np.ndarray:
    """Return (roll, pitch, yaw) [rad], (..., 3), of R = Rz(yaw) Ry(pitch) Rx(roll), (..., 3, 3)."""
    pitch = np.arctan2(-R[..., 2, 0], np.hypot(R[..., 2, 1], R[..., 2, 2]))
    return np.stack([np.arctan2(R[..., 2, 1], R[..., 2, 2]), pitch, np.arctan2(R[..., 1, 0], R[..., 0, 0])], axis=-1)
