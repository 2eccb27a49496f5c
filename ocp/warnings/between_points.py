"""`between_points`: regions that pass between the points by which a platform without a body is represented."""

from collections.abc import Sequence

import numpy as np

from ...base.errors import InputError
from ...base.text import quantity
from ...models.body import BodyHull
from ..limits.bodies import body_outside
from ..limits.limit import Limit
from ..limits.limits import Limits
from ..limits.places import PlatformOutside
from .instants import Instants

MOST = 200  # instants that are looked at, or less than twice as many
LEAST = 1e-3  # [m]: less inside is not worth a sentence


def between_points(seen: Instants, limits: Sequence[Limit], limited: Sequence[np.ndarray]) -> list[str]:
    """Return a sentence if a region enters the hull of centre of mass and attachments, all of which stay outside.

    Parameters
    ----------
    limits, limited
        Those of the task, and what they bound at the instants, (n, k) each.
    """
    robot = seen.robot
    kept = [
        (limit, its.min(axis=1))
        for limit, its in zip(limits, limited, strict=True)
        if isinstance(limit, PlatformOutside) and (its >= limit.low - limit.tolerance).all()
    ]
    if robot.platform.body is not None or not kept:
        return []
    points = np.vstack([robot.platform.com, robot.attachments])
    try:
        hull = BodyHull(kind="mesh", vertices=tuple(map(tuple, points.tolist())))
    except InputError:  # points of a plane have no hull that bodies could enter
        return []
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    near = np.flatnonzero(np.min([its for _, its in kept], axis=0) < size)
    if not near.size:
        return []
    near = near[:: max(len(near) // MOST, 1)]
    parts = [tuple(body_outside(hull, "", limit.place, limit.called, 0.0)) for limit, _ in kept]
    values = Limits(robot, sum(parts, ())).at_rest(seen.pose[near], seen.carriers[near])
    meetings = []
    for (limit, _), part in zip(kept, parts, strict=True):
        its = np.hstack([values.pop(0) for _ in part]).min(axis=1)
        if its.min() < -LEAST:
            time = seen.times[near[its.argmin()]]
            meetings.append((float(its.min()), f"{limit.called!r}", f" at t = {time:.3f} s"))
    if not meetings:
        return []
    depth, called, when = min(meetings)
    others = f" (and {len(meetings) - 1} more)" * (len(meetings) > 1)
    return [
        f"{called} passes between the points of the platform: it is {quantity(-depth, 'm', 3)} inside the hull of "
        f"centre of mass and attachments{when}{others}; a platform.body in the robot's file would keep it out"
    ]
