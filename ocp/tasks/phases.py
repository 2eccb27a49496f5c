"""`Phases`: the phases of a task laid out for its robot: loads as numbers, and the forces of the ground as columns.

On the ground the balance of wrenches is A t + S n = w. Each column of S is the wrench of a unit force that pushes
against gravity at one support point, and n >= 0. The tensions are continuous from phase to phase. So where a phase on
the ground meets one without ground, S n is the difference of the wrenches that their loads need at rest: zero where
the load stays, its weight where the load is left on the ground or not yet fixed to the platform.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from ...base.display import Displayed

SAME_TIME = 1e-9  # of the duration: an instant so near to the start of a phase belongs to it


@dataclass(frozen=True, eq=False)
class LaidPhase(Displayed):
    """A phase of a task."""

    name: str
    start: float  # [s]
    end: float  # likewise
    load: np.ndarray  # what the platform carries, (10,), as `Dynamics.carried_wrench` takes it; zeros: nothing
    # S, (6, s) [N per N, N m per N], moments about the platform's CoM, in {G}; s is 0 without ground.
    columns: np.ndarray
    slack: bool  # whether the lower limit of its tensions is 0
    at_start: np.ndarray  # bounds of the support forces at its ends, (2, s) [N]; the upper one may be infinite
    at_end: np.ndarray  # likewise
    extremes: np.ndarray  # loads within the tolerances that decide, (k, 10), as `load`; k is 0 for one that is known

    @property
    def rests(self) -> bool:
        """Return whether it is on the ground."""
        return self.columns.shape[1] > 0


@dataclass(frozen=True, eq=False)
class Phases(Displayed):
    """All phases of a task in order; none for a task that is not given in phases."""

    all: tuple[LaidPhase, ...] = ()

    @cached_property
    def boundaries(self) -> np.ndarray:
        """Return the times at which the phases begin, and the end, (k + 1,) [s]; empty without phases."""
        return np.array([phase.start for phase in self.all] + [phase.end for phase in self.all[-1:]])

    @cached_property
    def carry(self) -> bool:
        """Return whether the platform carries a load in some phase."""
        return any(phase.load[0] for phase in self.all)

    @cached_property
    def rest(self) -> bool:
        """Return whether some phase is on the ground."""
        return any(phase.rests for phase in self.all)

    @cached_property
    def supports(self) -> int:
        """Return the largest number of support points."""
        return max((phase.columns.shape[1] for phase in self.all), default=0)

    @cached_property
    def jumps(self) -> list[float]:
        """Return the times at which the load changes with no adjacent phase on the ground: the tensions jump [s]."""
        return [
            after.start
            for before, after in pairwise(self.all)
            if not (before.rests or after.rests) and not np.array_equal(before.load, after.load)
        ]

    def index_at(self, times: np.ndarray) -> np.ndarray:
        """Return the index of the phase to which each of `times` belongs, (n,): at a boundary the later one."""
        boundaries = self.boundaries
        return np.searchsorted(boundaries[1:-1] - SAME_TIME * boundaries[-1], times, side="right")

    def at(self, time: float) -> LaidPhase | None:
        """Return the phase to which a time belongs; None for a task without phases."""
        return self.all[int(self.index_at(np.array([time]))[0])] if self.all else None

    def rows(self, times: np.ndarray) -> list[tuple[LaidPhase, np.ndarray]]:
        """Return the phases to which some of `times` belong, each with the indices of these."""
        which = self.index_at(times)
        return [(self.all[index], np.flatnonzero(which == index)) for index in np.unique(which)]

    @cached_property
    def extremes(self) -> int:
        """Return the largest number of loads that decide within the tolerances of a phase."""
        return max((len(phase.extremes) for phase in self.all), default=0)

    def loads_at(self, times: np.ndarray, extreme: int | None = None) -> np.ndarray:
        """Return what the platform carries at `times`, (n, 10): the loads as given, or an extreme of each phase."""
        loads = [
            phase.load if extreme is None or extreme >= len(phase.extremes) else phase.extremes[extreme]
            for phase in self.all
        ]
        return np.array(loads)[self.index_at(times)]

    def columns_at(self, times: np.ndarray) -> np.ndarray:
        """Return S at `times`, (n, 6, s), zero without ground; s is `supports`."""
        columns = np.zeros((len(self.all), 6, self.supports))
        for index, phase in enumerate(self.all):
            columns[index, :, : phase.columns.shape[1]] = phase.columns
        return columns[self.index_at(times)]

    def resting(self, times: np.ndarray) -> np.ndarray:
        """Return at which of `times` the platform is on the ground, boundaries included, (n,)."""
        resting = np.zeros(len(times), bool)
        for phase in self.all:
            if phase.rests:
                resting |= self.within(phase, times)
        return resting

    def within(self, phase: LaidPhase, times: np.ndarray) -> np.ndarray:
        """Return which of `times` are within a phase, its boundaries included, (n,)."""
        reach = SAME_TIME * self.boundaries[-1]
        return (times >= phase.start - reach) & (times <= phase.end + reach)

    def support_bounds(self, times: np.ndarray) -> np.ndarray:
        """Return lower and upper bounds of the support forces at `times`, (2, n, supports) [N]."""
        bounds = np.zeros((2, len(times), self.supports))
        reach = SAME_TIME * self.boundaries[-1] if self.all else 0.0
        for phase, rows in self.rows(times):
            count = phase.columns.shape[1]
            bounds[1, rows, :count] = np.inf
            for end, limits in ((phase.start, phase.at_start), (phase.end, phase.at_end)):
                bounds[:, rows[np.abs(times[rows] - end) <= reach], :count] = limits[:, None]
        return bounds
