"""`sightings`: residuals of measured directions of cables, and their derivatives.

With the unit vector u along a cable, from its anchor, and the measured one d, the residual is (u - d) / sigma, of which
only the part across the cable is not zero to first order. Of an azimuth alone, with the horizontal unit vector h across
it and the horizontal part v of u, it is h . u / (|v| sigma).
"""

from typing import NamedTuple

import numpy as np

from ...core import columns_by_geometry
from ...models import points
from ..logs.measurements import Measurements
from .geometry import Runs, record_with
from .parameters import OF_ROBOT, Parameters

SEEN = (*range(6), 8)  # parameters of a cable on which its direction depends
STEEPEST = 1e-3  # horizontal part of a unit vector, of which an azimuth tells nothing


class Sighted(NamedTuple):
    """Residuals (m, N, 3) of directions and, if wanted, their derivatives, which are by each cable's own parameters.

    - `cables`: by anchor, attachment and radius of the pulley, the columns `SEEN`, (m, N, 3, 7).
    - `robot`: by the parameters of the robot, (m, N, 3, 17).
    - `poses`: by shift and rotation of the sample, (m, N, 3, 6).
    """

    residuals: np.ndarray
    cables: np.ndarray | None = None
    robot: np.ndarray | None = None
    poses: np.ndarray | None = None

    def leave_out(self, rows: np.ndarray) -> None:
        """Set residuals and derivatives of some samples, (N,) of bool, to zero in place."""
        for one in (self.residuals, self.cables, self.robot, self.poses):
            if one is not None:
                one[:, rows] = 0.0


def sightings(
    of: Parameters,
    x: np.ndarray,
    placed: tuple[np.ndarray, np.ndarray],
    run: Runs,
    carriers: np.ndarray,
    measurements: Measurements,
    carried: tuple[np.ndarray, np.ndarray] | None = None,
    derive: bool = True,
) -> Sighted | None:
    """Return residuals with positions (N, 3) and rotations (N, 3, 3) of the platform; None without directions.

    `run` is the geometry of the cables there, `carriers` are poses, and `carried` is `Carriers.of_cables` if these move
    with the clock offset. What was not measured has zeros.
    """
    if measurements.directions is None:
        return None
    u, d = run.directions, np.swapaxes(measurements.directions, 0, 1)
    m, count = d.shape[:2]
    known, flat = np.isfinite(d[..., 0]), np.isnan(d[..., 2])
    W = np.where((known & ~flat)[..., None, None], np.eye(3), 0.0)  # (m, N, 3, 3)
    steep = np.hypot(u[..., 0], u[..., 1])
    level = known & flat & (steep > STEEPEST)
    W[level, 0, 0], W[level, 0, 1] = -d[level, 1] / steep[level], d[level, 0] / steep[level]
    target = np.where(flat[..., None], 0.0, np.where(known[..., None], d, 0.0))
    W /= measurements.sigma.directions
    residuals = (W @ (u - target)[..., None])[..., 0]
    if not derive:
        return Sighted(residuals)
    (position, rotation), table = placed, of.table(x)
    at = np.ascontiguousarray(np.broadcast_to(carriers, (count, *carriers.shape[-2:])))
    poses = np.concatenate([position, points.angles(rotation)], axis=1)
    S = np.empty((count, m, 6, 7))
    columns_by_geometry(record_with(of.robot, table), poses, at, S)
    by_geometry = -W @ np.swapaxes(S[:, :, :3], 0, 1)  # (m, N, 3, 7)
    by_shift = by_geometry[..., 3:6] @ np.swapaxes(rotation, 1, 2)
    arms = np.einsum("nij,mj->mni", rotation, table[:, 3:6])
    by_turn = -by_shift @ points.skew(arms)
    of_robot = np.zeros((m, count, 3, OF_ROBOT))
    if carried is not None:
        velocity, rate = carried
        of_robot[..., 0] = (W @ np.cross(rate, u)[..., None] - by_shift @ velocity[..., None])[..., 0]
    return Sighted(residuals, by_geometry, of_robot, np.concatenate([by_shift, by_turn], axis=3))


def sighted(measurements: Measurements) -> np.ndarray:
    """Return how many equations the directions of each sample are, (N,): two for a cable, one for an azimuth."""
    d = measurements.directions
    if d is None:
        return np.zeros(len(measurements), dtype=int)
    return (np.isfinite(d[..., 0]) * (1 + np.isfinite(d[..., 2]))).sum(axis=1)
