"""Define the unknowns of a node of the transcription and their positions in its column."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ...base.display import Displayed
from ..limits import Limit
from ..tasks.scenario import Scenario

DURATION, MARGIN = "duration", "margin"


@dataclass(frozen=True)
class Layout(Displayed):
    """The column of a point.

    It has q, v, a (n each), tensions (m), those in each decisive wind of a box (m each), forces of the ground, missing
    wrenches (6 each or 0), one slack for each soft limit, and `carried`. A smooth scheme's column has jerk and snap
    after a, times the first and second power of an interval's length at the scenario's duration: so they are of the
    size of a.

    Each node carries a copy of what all nodes share, the duration and the margin, equal to the copy of the next node,
    so that the program stays banded.
    """

    n: int
    m: int
    derivatives: int
    winds: int
    grounds: int
    elastic: bool
    soft: tuple[str, ...]
    carried: tuple[str, ...]

    @staticmethod
    def of(scenario: Scenario, elastic: bool) -> Layout:
        """Return the layout that a scenario needs."""
        carried = [DURATION] * (scenario.duration_range is not None)
        carried += [MARGIN] * (scenario.task.objective.margin is not None)
        soft = tuple(dict.fromkeys(limit.name for limit in scenario.limits if limit.soft is not None))
        n, m, derivatives = scenario.count, scenario.robot.m, scenario.scheme.derivatives
        counts = n, m, derivatives, scenario.decisive_winds, scenario.phases.supports
        return Layout(*counts, elastic, soft, tuple(carried))

    @property
    def q(self) -> slice:
        """Return the slice of the free coordinates."""
        return slice(0, self.n)

    @property
    def v(self) -> slice:
        """Return the slice of their rates."""
        return slice(self.n, 2 * self.n)

    @property
    def a(self) -> slice:
        """Return the slice of their accelerations."""
        return slice(2 * self.n, 3 * self.n)

    @property
    def jerk(self) -> slice:
        """Return the slice of the jerk, which is empty unless the scheme is smooth."""
        return slice(3 * self.n, max(self.derivatives - 1, 3) * self.n)

    @property
    def snap(self) -> slice:
        """Return the slice of the snap, which is empty unless the scheme is smooth."""
        return slice(self.jerk.stop, self.motion.stop)

    @property
    def motion(self) -> slice:
        """Return the slice of the coordinates and all their derivatives."""
        return slice(0, self.derivatives * self.n)

    @property
    def tensions(self) -> slice:
        """Return the slice of the tensions, in units of the robot's force."""
        return slice(self.motion.stop, self.motion.stop + self.m)

    @property
    def wind_tensions(self) -> slice:
        """Return the slice of the tensions in the decisive winds of a box, one wind after another, in the same unit."""
        start = self.tensions.stop
        return slice(start, start + self.winds * self.m)

    @property
    def supports(self) -> slice:
        """Return the slice of the forces of the ground, in the same unit; zero where the platform hangs."""
        start = self.wind_tensions.stop
        return slice(start, start + self.grounds)

    @property
    def missing(self) -> slice:
        """Return the slice of an elastic program's missing wrenches: as planned, then in each decisive wind."""
        start = self.supports.stop
        return slice(start, start + 6 * (1 + self.winds) * self.elastic)

    @property
    def slacks(self) -> slice:
        """Return the slice of the excesses over soft limits, in their scale."""
        start = self.missing.stop
        return slice(start, start + len(self.soft))

    def slack_of(self, limit: str) -> int:
        """Return the index of a  soft limit's slack."""
        return self.slacks.start + self.soft.index(limit)

    def slack(self, x: ca.SX, limit: Limit) -> ca.SX | None:
        """Return the slack of a limit in column x; None if the limit is hard."""
        return None if limit.soft is None else x[self.slack_of(limit.name)]

    @property
    def shared(self) -> slice:
        """Return the slice of the shared unknowns."""
        start = self.slacks.stop
        return slice(start, start + len(self.carried))

    def at(self, name: str) -> int | None:
        """Return the index of a  shared unknown; None if there is none."""
        return self.shared.start + self.carried.index(name) if name in self.carried else None

    @property
    def width(self) -> int:
        """Return how many unknowns a node has."""
        return self.shared.stop
