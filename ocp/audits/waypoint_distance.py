"""`waypoint_distance`: the distance at which a motion passes the waypoints of its path."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...base.text import quantity
from ...models.points import rotation_vectors, rotations
from ..tasks.paths import Stations

LOOKS = 41  # about the instant that is nearest to a waypoint
EXACT = 1e-5  # [m, rad]: less is within the tolerances of a program


class Nearest(NamedTuple):
    """The waypoint that a motion passes at the largest distance."""

    point: str  # name of the waypoint in the path: `points[2]`
    # smallest distance of the motion from the waypoint, between the previous and the next waypoint, [m] for positions,
    # [rad] for attitudes
    distance: float
    time: float  # time of this distance [s]

    def describe(self, unit: str) -> str:
        """Return the distance in a thousandth of [m] or [rad], with the waypoint and the time."""
        return f"{quantity(1e3 * self.distance, unit)} (farthest from {self.point}, at t = {self.time:.3f} s)"


class WaypointDistance(NamedTuple):
    """The largest distance of a motion from the waypoints of its path, of positions and of attitudes."""

    position: Nearest
    attitude: Nearest

    def describe(self) -> str:
        """Return both in one line, except those that are passed exactly."""
        parts = ((self.position, "mm"), (self.attitude, "mrad"))
        said = [nearest.describe(unit) for nearest, unit in parts if nearest.distance > EXACT]
        return f"passed within {' and '.join(said)}" if said else "passed exactly"

    def to_dict(self) -> dict[str, Any]:
        """Return {"position": {"point", "distance", "at_s"}, "attitude": {"point", "angle", "at_s"}} for JSON."""
        (point, distance, at), (turned, angle, then) = self
        return {
            "position": {"point": point, "distance": distance, "at_s": at},
            "attitude": {"point": turned, "angle": angle, "at_s": then},
        }


def waypoint_distance(
    stations: Stations, times: np.ndarray, poses: np.ndarray, pose_at: Callable[[np.ndarray], np.ndarray]
) -> WaypointDistance | None:
    """Return where a motion passes its waypoints at the largest distance; None for a path without waypoints.

    Each waypoint is compared with the motion from the waypoint before to the one after it. The motion has `poses`
    (n, 6) [m, rad] in the frame of the path at `times` (n,) [s], and others by `pose_at`.
    """
    if not stations.names:
        return None

    def off(seen: np.ndarray, station: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turned = rotations(station[..., 3:]).swapaxes(-1, -2) @ rotations(seen[:, 3:])
        return seen[:, :3] - station[..., :3], rotation_vectors(turned)

    after, before = stations.windows
    first = np.maximum(np.searchsorted(times, after, side="right") - 1, 0)
    last = np.minimum(np.searchsorted(times, before, side="left"), len(times) - 1)
    nearest = np.empty((2, len(first)), int)
    for index, (start, end) in enumerate(zip(first, last, strict=True)):
        for kind, vectors in enumerate(off(poses[start : end + 1], stations.poses[index])):
            nearest[kind, index] = start + np.linalg.norm(vectors, axis=1).argmin()
    found = []
    for kind, rows in enumerate(nearest):
        looks = np.linspace(times[np.maximum(rows - 1, first)], times[np.minimum(rows + 1, last)], LOOKS, axis=1)
        vectors = off(pose_at(looks.ravel()), np.repeat(stations.poses, LOOKS, axis=0))[kind]
        distances, at = _nearest_on_lines(vectors.reshape(len(rows), LOOKS, 3), looks)
        worst = int(distances.argmax())
        found.append(Nearest(stations.names[worst], float(distances[worst]), float(at[worst])))
    return WaypointDistance(*found)


def _nearest_on_lines(points: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how near the lines through points (n, k, 3) come to the origin, and when, (n,) each."""
    along = np.diff(points, axis=1)
    squared = np.maximum(np.sum(along**2, axis=2), np.finfo(float).tiny)
    share = np.clip(-np.sum(points[:, :-1] * along, axis=2) / squared, 0.0, 1.0)
    distance = np.linalg.norm(points[:, :-1] + share[..., None] * along, axis=2)
    rows, best = np.arange(len(points)), distance.argmin(axis=1)
    return distance[rows, best], times[rows, best] + share[rows, best] * np.diff(times, axis=1)[rows, best]
