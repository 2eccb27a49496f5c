"""Rotations of a single pose, in microseconds: SciPy's take as long as a whole step of a filter."""

import math

import numpy as np


def axes_of(angles: np.ndarray) -> np.ndarray:
    """Return the axes in {G} about which roll, pitch and yaw turn, as columns (3, 3)."""
    (_, sp, sy), (_, cp, cy) = np.sin(angles), np.cos(angles)
    return np.array([[cy * cp, -sy, 0.0], [sy * cp, cy, 0.0], [-sp, 0.0, 1.0]])


def cross(v: np.ndarray) -> np.ndarray:
    """Return the matrix (3, 3) whose product with a vector is the cross product of v (3,) and it."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def turn_by(vector: np.ndarray) -> np.ndarray:
    """Return the rotation by a rotation vector (3,), (3, 3)."""
    angle, K = math.sqrt(vector @ vector), cross(vector)
    first, second = (math.sin(angle) / angle, math.sin(angle / 2) / angle) if angle else (1.0, 0.5)
    return np.eye(3) + first * K + 2 * second**2 * K @ K


def vector_of(R: np.ndarray) -> np.ndarray:
    """Return the rotation vector of a rotation by less than half a turn, (3,) [rad]."""
    twice = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = math.sqrt(twice @ twice) / 2
    return twice / 2 * (math.atan2(sine, (R.trace() - 1) / 2) / sine if sine else 1.0)
