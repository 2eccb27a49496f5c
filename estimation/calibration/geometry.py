"""Cable lengths and their derivatives by the numeric core, for varying parameters of a robot."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ...core import lines
from ...models import points
from ...models.record import record_of
from ...models.robot import Robot


class Runs(NamedTuple):
    """Lengths and directions of m cables at N samples; nan where no cable is tangent to its sheave."""

    lengths: np.ndarray  # lengths from the anchor over the pulley to the attachment [m], (m, N)
    # derivatives of the length by shift and rotation of the platform in {G}, (m, N, 6); the first three are the unit
    # vector along the cable towards the attachment
    by_pose: np.ndarray
    # derivatives of the length by the anchor in its carrier's frame (3), the attachment in the platform's (3) and the
    # radius of the pulley, (m, N, 7) [-]
    by_geometry: np.ndarray

    @property
    def directions(self) -> np.ndarray:
        """Return the unit vectors in {G} along the cables towards the attachments, (m, N, 3)."""
        return self.by_pose[..., :3]


def record_with(robot: Robot, table: np.ndarray) -> np.ndarray:
    """Return a record of the robot with the anchors, attachments and radii of a table of parameters, (m, 9 or more)."""
    record = record_of(robot).copy()
    cables = record["cable"][: robot.m]
    cables["anchor"], cables["attachment"], cables["radius"] = table[:, :3], table[:, 3:6], table[:, 8]
    return record


def runs(
    robot: Robot, table: np.ndarray, position: np.ndarray, rotation: np.ndarray, carriers: np.ndarray | None = None
) -> Runs:
    """Return the cable geometry with the platform at positions (N, 3) and rotations (N, 3, 3).

    - `table`: `Parameters.table`: anchors, attachments and, in its last column, radii, which replace the values of the
      robot, (m, 9). No cable is tangent to a negative radius.
    - `carriers`: their poses, (N, c, 6) or (c, 6) [m, rad]; default: at home.
    """
    m, count = robot.m, len(position)
    poses = np.concatenate([position, points.angles(rotation)], axis=1)
    lengths, A, by_geometry = np.empty((count, m)), np.empty((count, 6, m)), np.empty((count, m, 7))
    carriers = robot.carrier_home if carriers is None else np.ascontiguousarray(carriers)
    record = record_with(robot, table)
    record["com"] = 0.0  # so that moments are those about the platform's origin
    lines(record, poses, carriers, lengths, A, None, None, by_geometry)
    lengths[:, table[:, 8] < 0] = np.nan
    # Cables first, in this order also in memory, as the fit goes through them.
    by_pose = np.negative(A.transpose(2, 0, 1), order="C")
    return Runs(lengths.T.copy(), by_pose, by_geometry.swapaxes(0, 1).copy())


@lru_cache(maxsize=16)
def length_of(robot: Robot) -> float:
    """Return a length of the robot's cables, as a scale [m]: their mean at home."""
    return float(np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1).mean())
