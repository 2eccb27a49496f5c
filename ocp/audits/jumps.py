"""Check distances from thin places between the instants of the audit, where a fast motion may jump over them.

A distance changes by at most as much as the points move. So where it is large enough at two instants, the motion
between them cannot have passed the middle of a place, unless the points moved farther than both distances and the
place's thickness together. There, and only there, the motion is evaluated at as many instants more as it takes.
"""

from __future__ import annotations

import numpy as np

from ...models.points import placed
from .checks import AuditedMotion
from .excess import Excess

__all__ = ["jumped_over"]

MOST_PIECES = 100  # of the time between two instants


def jumped_over(audited: AuditedMotion, limited: list[np.ndarray]) -> list[Excess]:
    """Return the distances from places that are kept at the instants of the audit, but not between them.

    `limited` has the values of all limits at these instants.
    """
    limits, exceeded = audited.scenario.limits, list[Excess]()
    thin = [k for k, limit in enumerate(limits) if np.isfinite(limit.thickness * limit.per_metre)]
    moved = _moved(audited) if thin else np.zeros(0)
    for k in thin:
        limit, values = limits.all[k], limited[k]
        least = (values[:-1] + values[1:] - limit.per_metre * moved[:, None]).min(axis=1) / 2
        spans = np.flatnonzero(least <= -limit.thickness / 2)
        if not spans.size or (values < limit.low - limit.tolerance).any():
            continue
        pieces = min(int(np.ceil(moved[spans].max() / limit.thickness)) + 1, MOST_PIECES)
        starts, ends = audited.times[spans], audited.times[spans + 1]
        times = np.linspace(starts, ends, pieces, endpoint=False)[1:].ravel()
        between = limits.along(*audited.scenario.motion(times, audited.deviation))[k]
        row, which = np.unravel_index(between.argmin(), between.shape)
        value = float(between[row, which])
        if value < limit.low - limit.tolerance:
            about = limit.about(int(which))
            facts = (float(times[row]), value, limit.low, limit.unit, "at least")
            exceeded.append(Excess(limit.name, about, *facts))
    return exceeded


def _moved(audited: AuditedMotion) -> np.ndarray:
    """Return how far the points of platform and carriers move at most from each instant to the next, (n - 1,) [m]."""
    platform, carriers = audited.motion.pose, audited.carriers.pose
    com = placed(platform, np.array([audited.scenario.robot.platform.com]))
    points = [*audited.scenario.dynamics.points(platform, carriers), com, carriers[..., :3]]
    return np.linalg.norm(np.diff(np.concatenate(points, axis=1), axis=0), axis=2).max(axis=1)
