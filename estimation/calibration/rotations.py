"""Rotations in bulk, by SciPy: matrices from rotation vectors and quaternions, and back; small turns are in {G}."""

from __future__ import annotations

import numpy as np

__all__ = ["from_quaternions", "from_vectors", "quaternions_of", "vectors_of"]


def from_vectors(vectors: np.ndarray) -> np.ndarray:
    """Return the rotations about axes by angles, both as vectors (N, 3) [rad], (N, 3, 3) [-]."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vectors).as_matrix()


def vectors_of(R: np.ndarray) -> np.ndarray:
    """Return the rotation vectors [rad], (N, 3), of rotations (N, 3, 3), of angles up to half a turn."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_rotvec()


def from_quaternions(quaternions: np.ndarray) -> np.ndarray:
    """Return the rotations (N, 3, 3) of quaternions (x, y, z, w), (N, 4), of any length above zero."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(quaternions).as_matrix()


def quaternions_of(R: np.ndarray) -> np.ndarray:
    """Return the quaternions (x, y, z, w), (N, 4), of rotations (N, 3, 3); of either sign."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_quat()
