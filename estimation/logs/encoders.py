"""`lengths_of`: cable lengths from readings of the winches."""

import numpy as np

from ...models.robot import Robot


def lengths_of(robot: Robot, readings: np.ndarray, tensions: np.ndarray | None = None) -> np.ndarray:
    """Return cable lengths (..., m) [m] of readings, by the encoders of the file, under tensions [N] where measured."""
    encoders = [cable.encoder for cable in robot.cables]
    offset = np.array([one.offset if one else 0.0 for one in encoders])
    scale = np.array([one.scale if one else 1.0 for one in encoders])
    by = np.array([1 / cable.stiffness if cable.stiffness else 0.0 for cable in robot.cables])
    stretch = 1.0 if tensions is None else 1 + np.maximum(tensions, 0.0) * by
    build_up = np.array([one.build_up if one else 0.0 for one in encoders])
    return (offset + (scale + build_up * readings) * readings) * stretch
