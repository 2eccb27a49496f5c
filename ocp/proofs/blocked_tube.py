"""Prove that a keep-out region closes the whole cross-section of the tube: `blocked_tube`.

A point of the platform that is on one side of a plane at the start, and on the other at the end, crosses it. Where it
can, inside the tube, is the union of discs, which polygons enclose. The distance from a convex region is a convex
function, so the largest one in a polygon is at a corner. If all corners are too near, the platform cannot pass.
"""

from collections.abc import Callable
from typing import NamedTuple

import casadi as ca
import numpy as np

from ...base.text import quantity_row
from ...models.points import placed
from ...models.shapes import Block, Shape, skeleton
from ..audits.excess import Excess
from ..limits.clearance import point_outside
from ..limits.places import PLATFORM, PlatformOutside
from ..tasks.scenario import Scenario

INSTANTS = 1001  # at least
LONGEST = 0.01  # [s] between instants: nothing passes round a region in less, after a dwell of an hour either
CERTAIN = 1e-5  # [m]: distances are rounded, and audits accept less
AROUND = np.pi / 4 * np.arange(8)  # corners of a polygon around a disc


def blocked_tube(scenario: Scenario, ends: np.ndarray, reach: Callable[[int, np.ndarray], float]) -> list[Excess]:
    """Return the distance from a keep-out region that the platform cannot keep on its way, or nothing.

    - `ends`: poses at start and end, (2, 6).
    - `reach`: how far a point of the platform (3,) can be from where they or the path have it [m], by the number of
      the end, or 2 between them.
    """
    task, robot = scenario.task, scenario.robot
    regions = (region for region in task.limits.keep_out if region.frame == "world")
    places = [(region, region.platform) for region in regions if region.platform is not None]
    soft = PlatformOutside.name in task.limits.soft
    if not places or soft or scenario.relative or not np.isfinite(task.tube.radius):
        return []
    times = np.linspace(0.0, scenario.duration, max(INSTANTS, int(scenario.duration / LONGEST) + 2))
    poses = scenario.motion(times, None)[0].pose
    points, body = np.vstack([robot.platform.com, robot.attachments]), robot.platform.body
    if body is not None:
        points = skeleton(body).corners.mean(axis=0, keepdims=True)
    inside = 0.0 if body is None else -float(point_outside(body, ca.DM(points[0])))  # radius of a ball in the body
    for place, least in places:
        for point in points:
            path, both = (placed(its, point[None])[:, 0] for its in (poses, ends))
            moves = np.append(True, np.diff(path, axis=0).any(axis=1))  # a dwell of an hour is one place
            path = path[moves]
            if len(path) < 3:
                continue
            off = np.array([reach(end, point) for end in range(3)]) + CERTAIN
            off[2] += np.linalg.norm(np.diff(path, axis=0), axis=1).max()  # to the nearest instant, and as far again
            found = _crossing(place, path, both, off)
            if found is not None and found.distance - inside < least - CERTAIN:
                plane = f"plane with normal ({quantity_row(found.normal + 0.0)}) through the region's centre"
                why = f"at least, wherever in the tube it crosses the {plane}"
                about = f"{'platform' if body is None else PLATFORM} outside {place.name}"
                time, value = float(times[moves][found.row]), found.distance - inside
                return [Excess(PlatformOutside.name, about, time, value, least, "m", "at least", why)]
    return []


class _Crossing(NamedTuple):
    """The crossing of a plane through a region's centre by a point of the platform."""

    row: int  # the instant at which its path is nearest to the plane
    distance: float  # from the region at most [m]
    normal: np.ndarray  # of the plane, (3,)


def _crossing(place: Shape, path: np.ndarray, ends: np.ndarray, off: np.ndarray) -> _Crossing | None:
    """Return the crossing with the least distance, of some planes; None if the point need not cross any of them.

    - `path`, `ends`: where the point is without a deviation, (n, 3), and at start and end, (2, 3) [m].
    - `off`: its largest deviations at start, end and between [m].
    """
    corners = skeleton(place).corners
    centre = corners.mean(axis=0)
    nearest = np.linalg.norm(path - centre, axis=1).argmin().clip(1, len(path) - 2)
    along = path[nearest + 1] - path[nearest - 1]
    normals = [along / max(np.linalg.norm(along), CERTAIN)]
    normals += list(place.axes.T) if isinstance(place, Block) else []
    p = ca.SX.sym("p", 3)
    distance = ca.Function("distance", [p], [point_outside(place, p)])
    best = None
    for normal in normals:
        sides, heights = (ends - centre) @ normal, (path - centre) @ normal
        if sides[0] * sides[1] >= 0 or (np.abs(sides) <= off[:2]).any():
            continue
        rows = np.flatnonzero(np.abs(heights) <= off[2])
        across = np.linalg.svd(normal[None])[2][1:]  # (2, 3)
        around = np.stack([np.cos(AROUND), np.sin(AROUND)], axis=1) @ across / np.cos(AROUND[1] / 2)
        discs = np.sqrt(off[2] ** 2 - heights[rows] ** 2)[:, None, None] * around
        enclosing = (path[rows] - heights[rows, None] * normal)[:, None] + discs
        most = float(distance(enclosing.reshape(-1, 3).T).full().max())
        if best is None or most < best.distance:
            best = _Crossing(int(rows[np.abs(heights[rows]).argmin()]), most, normal)
    return best
