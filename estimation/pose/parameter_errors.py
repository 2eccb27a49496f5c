"""`length_errors`: errors of cable lengths due to the uncertainty of a robot file."""

import numpy as np

from ...core import lines
from ...models.parameters import locate
from ...models.record import record_of
from ...models.robot import Robot
from ..logs.encoders import readings_of

COLUMNS = {"anchor": 0, "attachment": 3, "radius": 6, "encoder": 7}  # of the derivatives of a length


def length_errors(
    robot: Robot, pose: np.ndarray, lengths: np.ndarray, carriers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives (N, m, p) of lengths at a pose minus measured ones by the file's p uncertain parameters.

    Encoders convert readings to measured lengths, and errors of their parameters are correlated with those of anchors
    because a calibration determines their sum. Also return d lengths / d (x, y, z, small rotation in {G}), (N, m, 6).

    - `robot`: a robot; p = 0 if its file has no uncertainty.
    - `pose`: poses of the platform in {G}, (N, 6) [m, rad].
    - `lengths`: measured lengths [m], (N, m); the strain of cables is neglected.
    - `carriers`: poses of the carriers, (c, 6) or (N, c, 6).
    """
    names = robot.uncertainty.parameters if robot.uncertainty else ()
    count, m = lengths.shape
    record, A, derivatives = record_of(robot).copy(), np.empty((count, 6, m)), np.empty((count, m, 7))
    record["com"] = 0.0  # moments are those about the platform's origin
    lines(record, np.ascontiguousarray(pose), carriers, np.empty((count, m)), A, None, None, derivatives)
    readings = readings_of(robot, lengths)
    by_encoder = -np.stack([np.ones_like(readings), readings, readings**2], axis=2)
    derivatives = np.concatenate([derivatives, by_encoder], axis=2)  # (N, m, 10)
    L = np.zeros((count, m, len(names)))
    for column, name in enumerate(names):
        cable, part, axis = locate(name)
        L[:, cable, column] = derivatives[:, cable, COLUMNS[part] + axis]
    return L, -np.swapaxes(A, 1, 2)
