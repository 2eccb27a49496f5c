"""`lengths_of`: cable lengths from readings of the winches, and `locked`: whether these hardly change."""

import numpy as np

from ...models.robot import Robot

LOCKED = 1e-4  # of a length, by which noise may change the reading of a locked winch


def lengths_of(robot: Robot, readings: np.ndarray, tensions: np.ndarray | None = None) -> np.ndarray:
    """Return cable lengths (..., m) [m] of readings, by the encoders of the file, under tensions [N] where measured."""
    offset, scale, build_up = robot.encoders.T
    by = np.array([1 / cable.stiffness if cable.stiffness else 0.0 for cable in robot.cables])
    stretch = 1.0 if tensions is None else 1 + np.maximum(tensions, 0.0) * by
    return (offset + (scale + build_up * readings) * readings) * stretch


def readings_of(robot: Robot, lengths: np.ndarray) -> np.ndarray:
    """Return readings of the winches (..., m) at unstrained cable lengths (..., m) [m]: the reverse of `lengths_of`."""
    offset, scale, build_up = robot.encoders.T
    root = np.sqrt(np.maximum(scale**2 + 4 * build_up * (lengths - offset), 0.0))
    return 2 * (lengths - offset) / (scale + np.copysign(root, scale))


def locked(lengths: np.ndarray) -> bool:
    """Return whether readings (N, m) hardly change, as those of locked winches."""
    known = lengths[np.isfinite(lengths).all(axis=1)]
    return len(known) > 1 and bool((np.ptp(known, axis=0) <= LOCKED * np.abs(known).max(axis=0)).all())
