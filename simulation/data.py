"""`SimulationData`: the numbers of a simulation, its `Record`, and the `Room` of floor and walls that a robot has."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from ..base.display import Displayed
from ..base.text import quantity
from ..control import ANSWERS, Command, Reference
from ..control.controller import NOTHING, OTHERWISE
from ..models.points import placed
from ..models.robot import Robot
from ..models.shapes import skeleton
from .conditions import Experiment

TENSION_TOLERANCE = 1e-3  # of a cable's range: what its tension may be above t_max
LEAST = 1e-3  # [m]: nearer than this a platform is inside
UPRIGHT = 1e-6  # of gravity, across z


class Period(NamedTuple):
    """A period of parallel runs, from its beginning on. The next one overwrites its arrays."""

    number: int  # number of the period, from 0
    alive: np.ndarray  # runs that have not diverged at its end, (N,)
    motions: np.ndarray  # as `core.sense` writes them
    lengths: np.ndarray  # likewise
    tensions: np.ndarray  # mean tensions over the period, (N, m) [N]
    command: Command  # command of all runs; for a single run its arrays have no leading dimension


class Record(Displayed):
    """Record motions, lengths, tensions and commands of one run, a row for each period."""

    def __init__(self, robot: Robot, periods: int):
        carriers, m = len(robot.carriers), robot.m
        self.actuation = np.full((periods, carriers, max(len(carrier.actuators) for carrier in robot.carriers)), np.nan)
        self.motions = np.full((periods, 1 + carriers, 12), np.nan)
        self.lengths, self.tensions = (np.full((periods, m), np.nan) for _ in range(2))
        self.commanded, self.commanded_lengths = (np.full((periods, m), np.nan) for _ in range(2))
        self.answered = np.zeros(periods, dtype=np.int8)
        self.direction, self.shortfall = np.full((periods, 6), np.nan), np.full(periods, np.nan)
        self.unexplained = np.full(periods, np.nan)
        self.released = np.zeros((periods, m), dtype=bool)
        self.orders = np.full((periods, carriers, 6), np.nan)

    def take(self, period: Period) -> None:
        """Keep a period."""
        k, command = period.number, period.command
        self.motions[k], self.lengths[k], self.tensions[k] = period.motions[0], period.lengths[0, 0], period.tensions[0]
        self.commanded[k], self.answered[k], self.orders[k] = command.tensions, command.answered, command.carrier_pose
        if command.answered:
            if not 0 < command.answered < len(ANSWERS) or command.answered != int(command.answered):
                raise IndexError(command.answered)
            self.direction[k], self.shortfall[k] = command.direction, command.shortfall
        if command.lengths is not None:
            self.commanded_lengths[k] = command.lengths
        if command.released is not None:
            self.released[k] = command.released
        if command.unexplained is not NOTHING:
            self.unexplained[k] = command.unexplained
        if command.actuation is not None:
            self.actuation[k] = command.actuation


class Room(NamedTuple):
    """Bounds in {G} of points of the platform's frame."""

    points: np.ndarray  # (k, 3) [m]
    bounds: np.ndarray  # least and largest coordinates, of points that have their radius as distance, (2, 3) [m]
    names: tuple[str, ...]  # of the sides in the order of bounds, (6,)
    is_known: bool  # whether the robot's file has them; otherwise the floor is where it usually is

    def beyond(self, poses: np.ndarray) -> np.ndarray:
        """Return how far the platform is beyond each side at poses (n, 6), (n, 6) [m]; negative inside."""
        least, most = (reduce(placed(poses, self.points), axis=1) for reduce in (np.min, np.max))
        return np.concatenate([self.bounds[0] - least, most - self.bounds[1]], axis=1)


@lru_cache(maxsize=16)
def room_of(robot: Robot) -> Room | None:
    """Return floor and walls of a robot; None if it has none, nor a usual floor.

    The usual floor is the plane z = 0 of {G}, if gravity points down and neither an anchor nor the platform at home is
    lower.
    """
    body, box = robot.platform.body, robot.workspace_box
    points, radius = np.vstack([robot.platform.com, robot.attachments]), 0.0
    if body is not None:
        points, radius = skeleton(body).corners, body.rounding
    bounds = np.array([[-np.inf] * 3, [np.inf] * 3] if box is None else [box.min, box.max])
    names = [f"beyond the {side} {axis} of the room" for side in ("smallest", "largest") for axis in "xyz"]
    is_known = box is not None or robot.floor is not None
    if not is_known:
        x, y, z = robot.gravity
        lowest = min(robot.home_anchors[:, 2].min(), placed(robot.home, points)[:, 2].min() - radius)
        if z >= 0 or np.hypot(x, y) > -UPRIGHT * z or lowest < 0:
            return None
        bounds[0, 2], names[2] = 0.0, "below z = 0 of {G}, where the floor usually is"
    elif robot.floor is not None and robot.floor >= bounds[0, 2]:
        bounds[0, 2], names[2] = robot.floor, "below the floor"
    return Room(points, bounds + np.array([[radius], [-radius]]), tuple(names), is_known)


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
