"""`Grid`: the points of a program in time. Phases and legs begin and end at nodes, with steps by their durations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.display import Displayed
from ..tasks.paths import WaypointPath
from ..tasks.scenario import Scenario

LEAST = 4  # steps of a phase, where there are enough


@dataclass(frozen=True)
class Grid(Displayed):
    """The points of a program."""

    shares: np.ndarray  # where all points are, inner ones too, (k,), from 0 to 1 of the duration
    weights: np.ndarray  # of the mean over the duration, at the points, (k,)
    steps: np.ndarray  # the length of each interval at the scenario's duration, (n,) [s]
    # The duration of the phase on the ground of which an interval is a part, (n,) [s]; 0: it is of none.
    take_up: np.ndarray

    @staticmethod
    def of(scenario: Scenario, steps: int) -> Grid:
        """Return the grid of so many steps."""
        scheme, phases = scenario.scheme, scenario.phases
        boundaries = (
            phases.boundaries / phases.boundaries[-1] if phases.all else np.array([0.0, *passed(scenario), 1.0])
        )
        durations = np.diff(boundaries) * scenario.duration
        rests = [phase.rests for phase in phases.all] or [False] * len(durations)
        counts = _counts(durations, steps)
        starts = np.append(0, np.cumsum(counts))
        shares = np.interp(scheme.shares(steps), starts / steps, boundaries)
        shares[starts * scheme.size] = boundaries
        lengths = np.repeat(durations / counts, counts)
        weights = scheme.quadrature(lengths / scenario.duration)
        return Grid(shares, weights, lengths, np.repeat(durations * rests, counts))

    @property
    def intervals(self) -> np.ndarray:
        """Return what an interval's rows need to know of it: its length and `take_up`, (2, n) [s]."""
        return np.stack([self.steps, self.take_up])


def passed(scenario: Scenario) -> list[float]:
    """Return the shares of the duration at which a leg ends and the next one begins, if their durations are free."""
    path = scenario.path
    knots = path.knots(scenario.duration) / scenario.duration if isinstance(path, WaypointPath) else []
    return [float(share) for share in knots[1:-1]] if scenario.passing else []


def _counts(durations: np.ndarray, steps: int) -> np.ndarray:
    """Return how many of the steps each phase has, in proportion to its duration but not too few."""
    least = max(min(LEAST, steps // len(durations)), 1)
    counts = np.full(len(durations), least)
    for _ in range(steps - counts.sum()):
        counts[int((durations / counts).argmax())] += 1
    return counts
