"""`sightings`: residuals of measured directions of cables, and their derivatives.

With the unit vector u along a cable, from its anchor, and the measured one d, the residual is (u - d) / sigma, of which
only the part across the cable is not zero to first order. Of an azimuth alone, with the horizontal unit vector h across
it and the horizontal part v of u, it is h . u / (|v| sigma).
"""

import numpy as np

from ...core import columns_by_geometry
from ...models import points
from ...models.record import record_of
from ..logs.measurements import Measurements
from .balance import Balanced
from .geometry import Runs
from .motion import cross
from .parameters import Parameters

STEEPEST = 1e-3  # horizontal part of a unit vector, of which an azimuth tells nothing


def sightings(
    of: Parameters,
    x: np.ndarray,
    placed: tuple[np.ndarray, np.ndarray],
    run: Runs,
    carriers: np.ndarray,
    measurements: Measurements,
    carried: tuple[np.ndarray, np.ndarray] | None = None,
    derive: bool = True,
) -> Balanced | None:
    """Return residuals (N, 3 m) with positions (N, 3) and rotations (N, 3, 3) of the platform; None without directions.

    `run` is the geometry of the cables there, `carriers` are poses, and `carried` is `Carriers.of_cables` if these move
    with the clock offset. What was not measured has zeros.
    """
    robot, d = of.robot, measurements.directions
    if d is None:
        return None
    position, rotation = placed
    count, m = d.shape[:2]
    u = np.swapaxes(run.directions, 0, 1)  # (N, m, 3)
    known, flat = np.isfinite(d[..., 0]), np.isnan(d[..., 2])
    W = np.where((known & ~flat)[..., None, None], np.eye(3), 0.0)
    steep = np.hypot(u[..., 0], u[..., 1])
    level = known & flat & (steep > STEEPEST)
    W[level, 0, 0], W[level, 0, 1] = -d[level, 1] / steep[level], d[level, 0] / steep[level]
    W /= measurements.sigma.directions
    target = np.where(flat[..., None], 0.0, d)
    residuals = (W @ (u - target)[..., None])[..., 0].reshape(count, 3 * m)
    if not derive:
        return Balanced(residuals)
    record, table = record_of(robot).copy(), of.table(x)
    cables = record["cable"][:m]
    cables["anchor"], cables["attachment"], cables["radius"] = table[:, :3], table[:, 3:6], table[:, 8]
    poses = np.concatenate([position, points.angles(rotation)], axis=1)
    S = np.empty((count, m, 6, 7))
    columns_by_geometry(record, poses, np.ascontiguousarray(carriers), S)
    by_geometry = -W @ S[:, :, :3]  # (N, m, 3, 7)
    by_shift = by_geometry[..., 3:6] @ np.swapaxes(rotation, 1, 2)[:, None]
    arms = np.einsum("nij,mj->nmi", rotation, table[:, 3:6])
    by_turn = -by_shift @ cross(arms.reshape(-1, 3)).reshape(count, m, 3, 3)
    by_parameters = np.zeros((count, m, 3, of.count))
    for i in range(m):
        own = i * (of.clock // m)
        by_parameters[:, i, :, own : own + 6] = by_geometry[:, i, :, :6]
        by_parameters[:, i, :, own + 8] = by_geometry[:, i, :, 6]
    if carried is not None:
        velocity, rate = (np.swapaxes(part, 0, 1)[..., None] for part in carried)
        turning = np.cross(rate[..., 0], u)[..., None]
        by_parameters[..., of.clock] = (W @ turning - by_shift @ velocity)[..., 0]
    by_pose = np.concatenate([by_shift, by_turn], axis=3).reshape(count, 3 * m, 6)
    return Balanced(residuals, by_parameters.reshape(count, 3 * m, of.count), by_pose)


def sighted(measurements: Measurements) -> np.ndarray:
    """Return how many equations the directions of each sample are, (N,): two for a cable, one for an azimuth."""
    d = measurements.directions
    if d is None:
        return np.zeros(len(measurements), dtype=int)
    return (np.isfinite(d[..., 0]) * (1 + np.isfinite(d[..., 2]))).sum(axis=1)
