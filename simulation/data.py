"""`SimulationData`: the numbers of a simulation, which events, figures and reports use."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.display import Displayed
from ..base.text import quantity
from ..control import ANSWERS, Reference
from ..control.command import OTHERWISE
from ..models.robot import Robot
from .experiment import Experiment
from .record import Record
from .room import LEAST, room_of

TENSION_TOLERANCE = 1e-3  # of a cable's range: what its tension may be above t_max


@dataclass(frozen=True, eq=False)
class SimulationData(Displayed):
    """Numbers of a simulation, without figures, files and reports.

    Attributes:
        robot: The robot.
        conditions: References, events and noise, see `Experiment`.
        seed: Seed of wind and noise.
        record: Motion, tensions and commands, a row for each period.
        lasted: Number of simulated periods; smaller than the number of references if the simulation diverged.
        tolerance: Largest position error allowed for a pass [m].
        wind: Velocity of the air in {G} [m/s], (K, 3); None if there is no air.
        seconds: Computing time of each step of the controller [s], (K,).
        wall: Wall time of the simulation [s].
    """

    robot: Robot
    conditions: Experiment
    seed: int
    record: Record
    lasted: int
    tolerance: float
    wind: np.ndarray | None
    seconds: np.ndarray
    wall: float

    @property
    def references(self) -> Sequence[Reference]:
        """Return the reference of each period."""
        return self.conditions.references

    @property
    def period(self) -> float:
        """Return the period of the controller [s]."""
        return self.conditions.period

    @property
    def _recorded(self) -> int:
        """Return the number of recorded periods: at least the first one, even if the simulation diverges in it."""
        return max(self.lasted, 1)

    @cached_property
    def times(self) -> np.ndarray:
        """Return the times at which the recorded periods begin [s], (n,)."""
        return self.period * np.arange(self._recorded)

    @cached_property
    def error(self) -> np.ndarray:
        """Return the distance of the platform from its reference [m], (n,)."""
        wanted = np.stack([reference.pose[:3] for reference in self.references[: self._recorded]])
        return np.linalg.norm(self.record.motions[: self._recorded, 0, :3] - wanted, axis=1)

    def _cut(self, later: int = 0) -> np.ndarray:
        """Return which cables are cut or released, (n, m), as the recorded periods begin, or `later` periods later."""
        gone = np.logical_or.accumulate(self.record.released[: self._recorded])
        return gone | self.conditions.cut(self.robot.m, np.arange(self._recorded) + later)

    @cached_property
    def slack(self) -> np.ndarray:
        """Return whether each cable with t_min > 0 is slack, (n, m)."""
        return (self.record.tensions[: self._recorded] <= 0) & (self.robot.t_min > 0) & ~self._cut()

    @cached_property
    def above(self) -> np.ndarray:
        """Return the excess of tensions over t_max plus its tolerance [N], (n, m); negative inside or undefined."""
        most = self.robot.t_max + TENSION_TOLERANCE * (self.robot.t_max - self.robot.t_min)
        return np.nan_to_num(self.record.tensions[: self._recorded] - most, nan=-np.inf)

    @cached_property
    def outside(self) -> np.ndarray:
        """Return how far the platform is beyond each side of its room [m], (n, 6); negative inside, see `Room`."""
        poses, room = self.record.motions[: self._recorded, 0, :6], room_of(self.robot)
        return np.full(poses.shape, -np.inf) if room is None else np.nan_to_num(room.beyond(poses), nan=-np.inf)

    @property
    def passed(self) -> bool:
        """Return whether the run meets all pass criteria: it ended near its reference, within limits, without slack."""
        return not self.failures

    @cached_property
    def failures(self) -> tuple[str, ...]:
        """Return the reasons why the run failed, a line each."""
        lines = []
        if self.lasted < len(self.references):
            lines.append(f"the simulation diverged at t = {self.lasted * self.period:.3f} s")
        at = int(self.error.argmax())  # the first nan, if there is one
        if np.isnan(self.error[at]):
            lines.append(f"the position is undefined at t = {self.times[at]:.3f} s")
        elif self.error[at] > self.tolerance:
            lines.append(
                f"error of {quantity(1e3 * self.error[at], 'mm', digits=3)} at t = {self.times[at]:.3f} s "
                f"(tolerance {quantity(1e3 * self.tolerance, 'mm')})"
            )
        room = room_of(self.robot)
        row, side = np.unravel_index(self.outside.argmax(), self.outside.shape)
        if room is not None and room.is_known and self.outside[row, side] > LEAST:
            deep = quantity(self.outside[row, side], "m")
            lines.append(f"the platform was {deep} {room.names[side]} at t = {self.times[row]:.3f} s")
        tensions = self.record.tensions[: self._recorded]
        row, cable = np.unravel_index(self.above.argmax(), self.above.shape)
        if self.above[row, cable] > 0:
            lines.append(
                f"{quantity(tensions[row, cable], 'N')} in cable {cable + 1} at t = {self.times[row]:.3f} s "
                f"(t_max {quantity(self.robot.t_max[cable], 'N')})"
            )
        if self.slack.any():
            row, cable = np.argwhere(self.slack)[0]
            lines.append(
                f"slack for {quantity(self.slack_s, 's')}, beginning with cable {cable + 1} at "
                f"t = {self.times[row]:.3f} s"
            )
        return tuple(lines)

    @property
    def slack_s(self) -> float:
        """Return the time with a slack cable whose t_min is above zero [s]."""
        return float(self.slack.any(axis=1).sum() * self.period)

    @property
    def answered(self) -> dict[str, int]:
        """Return the number of control steps with each status."""
        answered = self.record.answered[: self._recorded]
        counts = np.bincount(answered[answered >= 0], minlength=len(ANSWERS))  # not of a run without a controller
        return dict(zip(ANSWERS, counts.tolist(), strict=True))

    @property
    def handed_over(self) -> float | None:
        """Return when computed torque took over from predictive control [s], or None."""
        steps = np.flatnonzero(self.record.answered[: self._recorded] == OTHERWISE)
        return float(self.times[steps[0]]) if steps.size else None
