"""`Near`: the points of a program at which it keeps the distances from regions: those near the motion it starts from.

Most of a motion is far from most obstacles, and distances cost more than all else that a program evaluates. Those that
it leaves out are evaluated once for its solution; if one is exceeded there, the program is solved again with more.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...base.display import Displayed
from ..limits import Limit
from ..limits.limits import Limits
from ..limits.places import Inside
from ..tasks.deviation import Deviation
from ..tasks.scenario import Scenario
from ..tasks.task_limits import AnyKeepOut

BEND = 0.25  # of what a point moves in an interval: more than an arc is away from its chord


@dataclass(frozen=True)
class Near(Displayed):
    """The points at which a program keeps each limit, or each distance of one: of limits that are not local all."""

    chosen: np.ndarray  # (parts, points), see `parts`
    holds: np.ndarray  # where each is in force, (parts, points)

    @classmethod
    def everywhere(cls, scenario: Scenario, shares: np.ndarray) -> Self:
        """Return all points."""
        holds = _holds(scenario, shares)
        return cls(holds, holds)

    @classmethod
    def along(cls, scenario: Scenario, shares: np.ndarray, motion: Deviation, reach: float) -> Self:
        """Return the points where a region is nearer than its bound and `reach`, of the motion's extent, permit.

        `shares` are fractions of the motion's duration at the program's points.
        """
        slack, _, extent = _kept(scenario, shares, motion)
        holds = _holds(scenario, shares)
        of_limits = [[not is_local(scenario.limits.all[index])] for index, _ in parts(scenario.limits)]
        return cls((_wider(slack <= reach * extent) | of_limits) & holds, holds)

    def widened(self, scenario: Scenario, shares: np.ndarray, motion: Deviation, reach: float) -> Self:
        """Return these points, those that `along` returns, and those where the motion may exceed what is left out."""
        slack, moved, extent = _kept(scenario, shares, motion)
        more = _wider(slack <= reach * extent) & self.holds | self._exceeded(slack, moved)
        return replace(self, chosen=self.chosen | more)

    @property
    def is_everywhere(self) -> bool:
        """Return whether nothing is left out."""
        return bool((self.chosen | ~self.holds).all())

    @property
    def between(self) -> np.ndarray:
        """Return what holds from each point to the next, (parts, points - 1)."""
        return self.holds[:, 1:] & self.holds[:, :-1]

    def suffices(self, scenario: Scenario, shares: np.ndarray, motion: Deviation) -> bool:
        """Return whether a motion can exceed no limit where it is left out, at the points or between them."""
        slack, moved, _ = _kept(scenario, shares, motion)
        return not self._exceeded(slack, moved).any()

    def strays(self, scenario: Scenario, shares: np.ndarray, motion: Deviation) -> bool:
        """Return whether a motion is in a region that is left out there, deeper than a bend of its way would be."""
        slack, moved, _ = _kept(scenario, shares, motion)
        deep = slack[:, 1:-1] < -_bend(scenario, moved[1:] + moved[:-1])
        return bool((deep & ~self.chosen[:, 1:-1]).any())

    def _exceeded(self, slack: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Return where a motion may exceed a limit that is left out, at the points or beside them, (parts, points)."""
        left_out = ~self.chosen
        between = left_out[:, 1:] & left_out[:, :-1] & (slack[:, 1:] + slack[:, :-1] < moved)
        exceeded = (slack < 0.0) & left_out
        exceeded[:, 1:] |= between
        exceeded[:, :-1] |= between
        return exceeded


def _wider(chosen: np.ndarray) -> np.ndarray:
    """Return the chosen points and those beside them."""
    wide = chosen.copy()
    wide[:, 1:] |= chosen[:, :-1]
    wide[:, :-1] |= chosen[:, 1:]
    return wide


def parts(limits: Limits) -> list[tuple[int, slice]]:
    """Return, for each row of `Near.chosen`, the index of its limit, and which values of it the row is about.

    Of distances from a region each has a row of its own: where one cable is near, most others are not.
    """
    counts = [len(limit.labels) if is_local(limit) and _is_of_place(limit) else 1 for limit in limits]
    return [(index, slice(i, None, count)) for index, count in enumerate(counts) for i in range(count)]


def is_local(limit: Limit) -> bool:
    """Return whether a program has rows of a limit only at some points: of a hard distance, or one of some phases."""
    return limit.phases is not None or (limit.soft is None and (_is_of_place(limit) or isinstance(limit, Inside)))


def _is_of_place(limit: Limit) -> bool:
    return bool(np.isfinite(limit.thickness))


def _holds(scenario: Scenario, shares: np.ndarray) -> np.ndarray:
    """Return where each part of a limit is in force, (parts, points)."""
    holds = [scenario.in_force(limit, shares * scenario.duration) for limit in scenario.limits]
    return np.array([holds[index] for index, _ in parts(scenario.limits)], dtype=bool).reshape(-1, len(shares))


def has_places(scenario: Scenario) -> bool:
    """Return whether any hard limit of a scenario is a distance from a region."""
    return any(is_local(limit) and _is_of_place(limit) for limit in scenario.limits)


def regions_near(scenario: Scenario, motion: Deviation, reach: float) -> tuple[AnyKeepOut, ...]:
    """Return the keep-out regions of a task that are hard, and to which a motion comes as near as for `Near.along`."""
    slack, _, extent = _kept(scenario, motion.nodes / motion.nodes[-1], motion)
    limits = (scenario.limits.all[index] for index, _ in parts(scenario.limits))
    near = {
        id(getattr(limit, "region", None))
        for limit, its in zip(limits, slack.min(axis=1), strict=True)
        if its <= reach * extent
    }
    return tuple(region for region in scenario.task.limits.keep_out if id(region) in near)


def jumps(scenario: Scenario, motion: Deviation) -> bool:
    """Return whether a motion passes through a region between two of its nodes, deeper than a bend of its way would."""
    nodes = motion.nodes / motion.nodes[-1]
    shares = np.insert(nodes, np.arange(1, len(nodes)), (nodes[1:] + nodes[:-1]) / 2)
    slack, moved, _ = _kept(scenario, shares, motion)
    return bool((slack[:, 1::2] < -_bend(scenario, moved[::2] + moved[1::2])).any())


def _bend(scenario: Scenario, moved: np.ndarray) -> np.ndarray:
    """Return how deep the bend of a way of length `moved` (k,) may be in each region, (parts, k) [m].

    It is not nearer to the middle than to the surface, where a program would come out of a thin region on either side.
    """
    halfway = np.array([scenario.limits.all[index].thickness / 4 for index, _ in parts(scenario.limits)])
    return np.minimum(BEND * moved, halfway[:, None])


def _kept(scenario: Scenario, shares: np.ndarray, motion: Deviation) -> tuple[np.ndarray, np.ndarray, float]:
    """Return how local limits are kept at shares of a motion, (parts, points) [m]: infinite slack for all others.

    Then what any point of platform or carriers moves from one share to the next, (points - 1,) [m], and the largest
    distance of two places of the same point [m], at least; at most sqrt(3) times less.
    """
    lasting = scenario.lasting(float(motion.nodes[-1]))
    platform, carriers = lasting.motion(shares * lasting.duration, motion)
    points = scenario.moving_points(platform.pose, carriers.pose)
    slack, values = [], lasting.limits.along(platform, carriers)
    for index, picked in parts(lasting.limits):
        limit, its = lasting.limits.all[index], values[index][:, picked]
        row = np.full(len(shares), np.inf)
        if is_local(limit):
            row = np.minimum(its - limit.low, limit.high - its).min(axis=1)
            row[~lasting.in_force(limit, shares * lasting.duration)] = np.inf
        slack.append(row)
    moved = np.linalg.norm(np.diff(points, axis=0), axis=2).max(axis=1, initial=0.0)
    return np.array(slack).reshape(-1, len(shares)), moved, float(np.ptp(points, axis=0).max())
