"""Define the unknowns of a node of the transcription and their positions in its column."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np

from ...base.display import Displayed
from ..limits import Limit
from ..tasks.scenario import Scenario

DURATION, MARGIN = "duration", "margin"


@dataclass(frozen=True)
class Layout(Displayed):
    """The column of a point.

    Each node carries a copy of what all nodes share, the duration and the margin, equal to the copy of the next node,
    so that the program stays banded.
    """

    # the number of free coordinates, and how many of these and their derivatives are unknowns
    n: int
    derivatives: int
    # the number of decisive winds of a box or of extreme loads, and of forces of the ground
    winds: int
    grounds: int
    # the names of the soft limits, and of what all nodes share
    soft: tuple[str, ...]
    carried: tuple[str, ...]
    # rows of the column with the free coordinates, their rates and accelerations
    q: slice
    v: slice
    a: slice
    # jerk and snap of a smooth scheme, times the first and second power of an interval's length at the scenario's
    # duration: so they are of the size of a. Empty for other schemes.
    jerk: slice
    snap: slice
    # tensions in units of the robot's force: the planned ones, and those in each decisive wind or with each extreme
    # load, one after another
    tensions: slice
    wind_tensions: slice
    supports: slice  # the forces of the ground, in the same unit; zero where the platform hangs
    missing: slice  # an elastic program's missing wrenches: as planned, then in each decisive wind
    slacks: slice  # the excesses over soft limits, in their scale
    shared: slice  # the shared unknowns
    width: int  # how many unknowns a node has

    @staticmethod
    def of(scenario: Scenario, elastic: bool) -> Layout:
        """Return the layout that a scenario needs."""
        carried = [DURATION] * (scenario.duration_range is not None)
        carried += [MARGIN] * (scenario.task.objective.margin is not None)
        soft = tuple(dict.fromkeys(limit.name for limit in scenario.limits if limit.soft is not None))
        n, m, winds, grounds = scenario.count, scenario.robot.m, scenario.decisive, scenario.phases.supports
        smooth = n * scenario.scheme.smooth
        sizes = [n, n, n, smooth, smooth, m, winds * m, grounds, 6 * (1 + winds) * elastic, len(soft), len(carried)]
        ends = np.cumsum([0, *sizes]).tolist()
        slices = (slice(*pair) for pair in pairwise(ends))
        return Layout(n, scenario.scheme.derivatives, winds, grounds, soft, tuple(carried), *slices, width=ends[-1])

    def slack_of(self, limit: str) -> int:
        """Return the index of a soft limit's slack."""
        return self.slacks.start + self.soft.index(limit)

    def slack(self, x: ca.SX, limit: Limit) -> ca.SX | None:
        """Return the slack of a limit in column x; None if the limit is hard."""
        return None if limit.soft is None else x[self.slack_of(limit.name)]

    def at(self, name: str) -> int | None:
        """Return the index of a shared unknown; None if there is none."""
        return self.shared.start + self.carried.index(name) if name in self.carried else None
