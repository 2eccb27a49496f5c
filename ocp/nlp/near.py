"""`Near`: the points of a program at which it keeps the distances from regions: those near the motion it starts from.

Most of a motion is far from most obstacles, and distances cost more than all else that a program evaluates. Those that
it leaves out are evaluated once for its solution; if one is exceeded there, the program is solved again with more.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from ...base.display import Displayed
from ...models.points import placed
from ..limits import Limit
from ..limits.bodies import Inside
from ..tasks.deviation import Deviation
from ..tasks.scenario import Scenario


@dataclass(frozen=True)
class Near(Displayed):
    """The points at which a program keeps each limit, (limits, points): of limits that are not local all.

    Attributes
    ----------
    holds
        Where each limit is in force, (limits, points); default: everywhere.
    """

    chosen: np.ndarray
    holds: np.ndarray | None = None

    @classmethod
    def everywhere(cls, scenario: Scenario, shares: np.ndarray) -> Self:
        """Return all points."""
        holds = _holds(scenario, shares)
        return cls(holds, holds)

    @classmethod
    def along(cls, scenario: Scenario, shares: np.ndarray, motion: Deviation, reach: float) -> Self:
        """Return the points where a region is nearer than its bound and `reach`, of the motion's extent, permit.

        `shares` are those of the motion's duration at the program's points.
        """
        slack, _, extent = _kept(scenario, shares, motion)
        chosen = slack <= reach * extent
        wide = chosen.copy()
        wide[:, 1:] |= chosen[:, :-1]
        wide[:, :-1] |= chosen[:, 1:]
        holds = _holds(scenario, shares)
        return cls((wide | [[not is_local(limit)] for limit in scenario.limits]) & holds, holds)

    @property
    def is_everywhere(self) -> bool:
        """Return whether nothing is left out."""
        return bool((self.chosen if self.holds is None else self.chosen | ~self.holds).all())

    @property
    def between(self) -> np.ndarray:
        """Return which limits hold from each point to the next, (limits, points - 1)."""
        holds = np.ones_like(self.chosen) if self.holds is None else self.holds
        return holds[:, 1:] & holds[:, :-1]

    def suffices(self, scenario: Scenario, shares: np.ndarray, motion: Deviation) -> bool:
        """Return whether a motion can exceed no limit where it is left out, at the points or between them."""
        slack, moved, _ = _kept(scenario, shares, motion)
        left_out = ~self.chosen
        between = left_out[:, 1:] & left_out[:, :-1] & (slack[:, 1:] + slack[:, :-1] < moved)
        return not ((slack < 0.0) & left_out).any() and not between.any()


def is_local(limit: Limit) -> bool:
    """Return whether a program has rows of a limit only at some points: of a hard distance, or one of some phases."""
    return limit.phases is not None or (limit.soft is None and (_is_of_place(limit) or isinstance(limit, Inside)))


def _is_of_place(limit: Limit) -> bool:
    return bool(np.isfinite(limit.thickness))


def _holds(scenario: Scenario, shares: np.ndarray) -> np.ndarray:
    """Return where each limit is in force, (limits, points)."""
    holds = [scenario.in_force(limit, shares * scenario.duration) for limit in scenario.limits]
    return np.array(holds, dtype=bool).reshape(-1, len(shares))


def has_places(scenario: Scenario) -> bool:
    """Return whether any hard limit of a scenario is a distance from a region."""
    return any(is_local(limit) and _is_of_place(limit) for limit in scenario.limits)


def _kept(scenario: Scenario, shares: np.ndarray, motion: Deviation) -> tuple[np.ndarray, np.ndarray, float]:
    """Return how local limits are kept at shares of a motion, (limits, points) [m]: infinite slack for all others.

    Then what any point of platform or carriers moves from one share to the next, (points - 1,) [m], and the largest
    distance of two places of the same point [m], at least; at most sqrt(3) times less.
    """
    lasting = scenario.lasting(float(motion.nodes[-1]))
    platform, carriers = lasting.motion(shares * lasting.duration, motion)
    corners = placed(platform.pose, scenario.body_corners)
    points = np.concatenate([*scenario.dynamics.points(platform.pose, carriers.pose), corners], axis=1)
    slack = np.full((len(lasting.limits.all), len(shares)), np.inf)
    for row, limit, values in zip(slack, lasting.limits, lasting.limits.along(platform, carriers), strict=True):
        if is_local(limit):
            row[:] = np.minimum(values - limit.low, limit.high - values).min(axis=1)
            row[~lasting.in_force(limit, shares * lasting.duration)] = np.inf
    moved = np.linalg.norm(np.diff(points, axis=0), axis=2).max(axis=1, initial=0.0)
    return slack, moved, float(np.ptp(points, axis=0).max())
