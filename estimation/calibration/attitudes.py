"""`misread_attitudes`: orientations without positions, as of an AHRS, in another frame or convention than the file's.

The orientation in which the platform hangs or is held by its cables follows from the lengths, and differs from the
measured one by a rotation of the sensor's world, such as that to magnetic north, or of the sensor on the platform.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...base.errors import InputError
from ...base.text import quantity, quantity_row
from ...models import points
from ...models.robot import Robot
from ..logs.encoders import lengths_of
from ..logs.measurements import Measurements, changed, measured_poses
from ..pose.from_lengths import pose_from_lengths
from .interpretations import interpretations

MOST_SAMPLES, FEWEST = 40, 6
CLEARLY = 3.0  # times smaller differences
VISIBLE = np.radians(8.0)  # offsets of the readings turn a platform less


class Misread(NamedTuple):
    """An error of the measured orientations, in one line, and the measurements without it."""

    text: str
    corrected: Measurements


def misread_attitudes(robot: Robot, given: Measurements) -> Misread | None:
    """Return what is wrong with orientations that were measured without positions, or None."""
    _, rotation, known = measured_poses(robot, given)
    rows = np.flatnonzero(known[:, 3:].all(axis=1))
    if given.poses is None or known[:, :3].any() or len(rows) < FEWEST or not robot.dof_mask[3:].all():
        return None
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_SAMPLES)).astype(int))]
    carriers = None if given.carrier_poses is None else given.carrier_poses[rows]
    try:
        estimate = pose_from_lengths(robot, lengths_of(robot, given.lengths[rows]), None, carriers)
    except InputError:  # lengths that no cable has
        return None
    good = np.asarray(estimate.converged & np.isfinite(estimate.pose).all(axis=1))
    if good.sum() < FEWEST:
        return None
    rows, expected = rows[good], Rotation.from_matrix(points.rotations(estimate.pose[good, 3:]))
    tried: list[tuple[float, float, str, Rotation, Rotation, int]] = []
    none = Rotation.identity()
    ways = [way for way in interpretations(True) if way.turned is not None or not way.text]
    for k, way in enumerate(ways):
        R = rotation[rows] if way.turned is None else way.turned(rotation[rows], given.poses[rows, 3:])
        seen = Rotation.from_matrix(R)
        outer, inner = (expected * seen.inv()).mean(), (seen.inv() * expected).mean()
        for left, right, frame in ((none, none, ""), (outer, none, "world"), (none, inner, "sensor")):
            size = float(np.median((left * seen * right * expected.inv()).magnitude()))
            corrections = (k > 0) + bool(frame)
            about = (left * right).as_rotvec()
            angle = float(np.linalg.norm(about))
            axis = quantity_row(np.round(about / max(angle, 1e-12), 2), digits=2)
            size_of = quantity(np.degrees(angle), "deg", 3)
            turned = f"the {frame} of the orientations looks turned by {size_of} about ({axis})"
            text = " and ".join(part for part in (way.text, turned if frame else "") if part)
            tried.append((size * CLEARLY**corrections, size, text, left, right, k))
    best = min(tried, key=lambda one: one[0])
    if not best[2] or tried[0][1] < VISIBLE:
        return None
    _, size, text, left, right, k = best
    turn = ways[k].turned
    every = rotation if turn is None else turn(rotation, np.nan_to_num(given.poses[:, 3:]))
    angles = points.angles((left * Rotation.from_matrix(every) * right).as_matrix())
    poses = np.hstack([given.poses[:, :3], np.where(known[:, 3:], angles, np.nan)])
    by = [quantity(np.degrees(part), "deg", 2) for part in (size, tried[0][1])]
    text = f"{text}: they differ from those by the lengths by {by[0]}, not by {by[1]}"
    return Misread(text, changed(given, poses=poses))
