"""Which unknowns a node of the transcription has, and where they are in its column."""

from __future__ import annotations

from dataclasses import dataclass

from ..tasks.scenario import Scenario

__all__ = ["Layout"]

DURATION, MARGIN = "duration", "margin"


@dataclass(frozen=True)
class Layout:
    """A point's column.

    That is q, v, a (n each), tensions (m), those in each decisive wind of a box (m each), missing wrenches (6 each or
    0), one slack a soft limit, `carried`. A smooth scheme's column has jerk and snap after a, times the first and
    second power of an interval's length at the scenario's duration: so they are of the size of a.

    What all nodes share, the duration and the margin, each node carries a copy of, equal to the next one's: so the
    program stays banded.
    """

    n: int
    m: int
    derivatives: int
    winds: int
    elastic: bool
    soft: tuple[str, ...]
    carried: tuple[str, ...]

    @staticmethod
    def of(scenario: Scenario, elastic: bool) -> Layout:
        """The layout that a scenario needs."""
        carried = [DURATION] * (scenario.duration_range is not None)
        carried += [MARGIN] * (scenario.task.objective.margin is not None)
        soft = tuple(scenario.task.limits.soft)
        n, m, derivatives = scenario.count, scenario.robot.m, scenario.scheme.derivatives
        return Layout(n, m, derivatives, scenario.decisive_winds, elastic, soft, tuple(carried))

    @property
    def q(self) -> slice:
        """Free coordinates."""
        return slice(0, self.n)

    @property
    def v(self) -> slice:
        """Their rates."""
        return slice(self.n, 2 * self.n)

    @property
    def a(self) -> slice:
        """Their accelerations."""
        return slice(2 * self.n, 3 * self.n)

    @property
    def jerk(self) -> slice:
        """Of a smooth scheme; else empty."""
        return slice(3 * self.n, max(self.derivatives - 1, 3) * self.n)

    @property
    def snap(self) -> slice:
        """Of a smooth scheme; else empty."""
        return slice(self.jerk.stop, self.motion.stop)

    @property
    def motion(self) -> slice:
        """All of these."""
        return slice(0, self.derivatives * self.n)

    @property
    def tensions(self) -> slice:
        """In units of the robot's force."""
        return slice(self.motion.stop, self.motion.stop + self.m)

    @property
    def wind_tensions(self) -> slice:
        """Those in the decisive winds of a box, one wind after another, likewise."""
        start = self.tensions.stop
        return slice(start, start + self.winds * self.m)

    @property
    def missing(self) -> slice:
        """Missing wrenches, of an elastic program: of the planned tensions, then of those in each decisive wind."""
        start = self.wind_tensions.stop
        return slice(start, start + 6 * (1 + self.winds) * self.elastic)

    @property
    def slacks(self) -> slice:
        """How far soft limits are passed, in their scale."""
        start = self.missing.stop
        return slice(start, start + len(self.soft))

    def slack_of(self, limit: str) -> int | None:
        """Place of a soft limit's slack; None if the limit is hard."""
        return self.slacks.start + self.soft.index(limit) if limit in self.soft else None

    @property
    def shared(self) -> slice:
        """What all nodes share."""
        start = self.slacks.stop
        return slice(start, start + len(self.carried))

    def at(self, name: str) -> int | None:
        """Place of a shared unknown; None if there is none."""
        return self.shared.start + self.carried.index(name) if name in self.carried else None

    @property
    def width(self) -> int:
        """How many unknowns a node has."""
        return self.shared.stop
