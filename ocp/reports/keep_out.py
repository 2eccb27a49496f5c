"""`outline`: lines along the surface of a keep-out region, as figures and viewer draw it."""

import numpy as np

from ...figures.robot import box_edges
from ..tasks.task_limits import AnyKeepOut, Block, ConvexMesh, Sphere

ROUND = np.linspace(0.0, 2 * np.pi, 41)


def outline(place: AnyKeepOut) -> list[np.ndarray]:
    """Return lines (n, 3) in {G} [m] along the surface of a keep-out region."""
    if isinstance(place, Block):
        return [place.centre + edge @ place.axes.T for edge in box_edges(-place.half, place.half)]
    if isinstance(place, ConvexMesh):
        return list(place.body.edges)
    if isinstance(place, Sphere):
        centre = np.array(place.centre)
        return [centre + ring for ring in _rings(place.radius, np.eye(3))]
    start, end = np.array(place.start), np.array(place.end)
    # The axis first: the rings across it sit at the ends, and straight lines join them.
    _, _, axes = np.linalg.svd(np.array([end - start]))
    rings = [at + ring for at in (start, end) for ring in _rings(place.radius, axes)]
    sides = [place.radius * sign * axis for axis in axes[1:] for sign in (1, -1)]
    return rings + [np.stack([start + side, end + side]) for side in sides]


def _rings(radius: float, axes: np.ndarray) -> list[np.ndarray]:
    """Return three circles about the origin, one across each axis of (3, 3)."""
    pairs = ((axes[1], axes[2]), (axes[2], axes[0]), (axes[0], axes[1]))
    return [radius * (np.cos(ROUND)[:, None] * u + np.sin(ROUND)[:, None] * v) for u, v in pairs]
