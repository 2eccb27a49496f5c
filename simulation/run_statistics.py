"""`Extremes`: statistics of each of many runs: errors, extreme tensions, slack, and the status of control steps."""

import numpy as np

from ..control import ANSWERS
from ..control.command import PLANNED
from ..models.robot import Robot
from .experiment import Experiment
from .record import Period
from .room import room_of

# The statistics of a run: its number of periods, errors [m], tensions [N] of cables that are not cut, their excess over
# t_max relative to the cable's range, how far the platform was out of its room [m], the number of periods that begin
# with a slack cable whose t_min is above zero, the number of periods with each status, and of each part of the time the
# largest error [m], smallest tension and largest tension [N]: nan in parts that it does not have.
PARTS = 100  # of the time
FIGURES = np.dtype(
    [
        ("lasted", "<i8"),
        *((name, "<f8") for name in ("error_rms", "error_max", "tension_min", "tension_max", "exceeded", "outside")),
        ("slack", "<i8"),
        ("answered", "<i8", (len(ANSWERS),)),
        ("over_time", "<f4", (PARTS, 3)),
    ]
)


class Extremes:
    """Accumulate per-run statistics. Each period takes a few operations on whole arrays."""

    def __init__(self, conditions: Experiment, robot: Robot, flights: int):
        self._references, self._t_max, self._range = conditions.references, robot.t_max, robot.t_max - robot.t_min
        periods = np.arange(len(conditions.references))
        self._taut = (robot.t_min > 0) & ~conditions.cut(robot.m, periods)  # where a slack cable is a failure
        self._cut = conditions.cut(robot.m, periods + 1)  # also inside the period
        self._kept: np.ndarray | None = None  # cables that are not released, (N, m); None: all
        self._rows = np.arange(flights)
        self._squares, self._largest = np.zeros(flights), np.zeros(flights)  # of the errors: sum, and largest
        self._slack, self._answers = np.zeros(flights, dtype=int), np.zeros((flights, len(ANSWERS)), dtype=int)
        # Squared error, negative tension and tension, of which the largest count.
        self._over_time = np.full((flights, PARTS, 3), np.nan, dtype="f4")
        room = room_of(robot)
        self._room, self._outside = room if room and room.is_known else None, np.zeros(flights)
        self._least, self._most = np.full(flights, np.inf), np.full((flights, robot.m), -np.inf)

    def take(self, period: Period) -> None:
        """Keep a period."""
        alive, command = period.alive, period.command
        rows = slice(None) if alive.all() else np.flatnonzero(alive)
        tensions = period.tensions[rows]
        off = period.motions[rows, 0, :3] - self._references[period.number].pose[:3]
        off *= off
        square = off[:, 0] + off[:, 1] + off[:, 2]
        self._squares[rows] += square
        self._largest[rows] = np.maximum(self._largest[rows], square)
        if self._room is not None:
            beyond = self._room.beyond(period.motions[rows, 0, :6]).max(axis=1)
            self._outside[rows] = np.fmax(self._outside[rows], beyond)
        cut, taut = self._cut[period.number], self._taut[period.number]
        whole = ~cut if cut.any() else True  # a mask takes longer
        if command.released is not None:
            kept = ~np.broadcast_to(np.asarray(command.released, dtype=bool), period.tensions.shape)
            self._kept = kept if self._kept is None else self._kept & kept
        if self._kept is not None:
            whole, taut = whole & self._kept[rows], taut & self._kept[rows]
        self._most[rows] = np.maximum(self._most[rows], tensions, where=whole, out=self._most[rows])
        least = tensions.min(axis=1, where=whole, initial=np.inf)
        most = tensions.max(axis=1, where=whole, initial=-np.inf)
        self._least[rows] = np.minimum(self._least[rows], least)
        part = period.number * PARTS // len(self._references)
        for k, each in enumerate((square, -least, most)):
            self._over_time[rows, part, k] = np.fmax(self._over_time[rows, part, k], each)
        if not tensions.min() > 0:
            self._slack[rows] += ((tensions <= 0) & taut).any(axis=1)
        answered = np.atleast_1d(command.answered)[rows]
        if answered.any():
            self._answers[self._rows[rows], answered] += 1
        else:
            self._answers[rows, PLANNED] += 1

    def figures(self, lasted: np.ndarray) -> np.ndarray:
        """Return the statistics of runs of `lasted` periods each, (N,) of `FIGURES`; no tensions are 0 N."""
        result = np.zeros(len(lasted), dtype=FIGURES)
        result["lasted"], result["slack"], result["answered"] = lasted, self._slack, self._answers
        result["error_rms"] = np.sqrt(self._squares / np.maximum(lasted, 1))
        result["error_max"], result["outside"] = np.sqrt(self._largest), self._outside
        for name, each in (("tension_min", self._least), ("tension_max", self._most.max(axis=1))):
            result[name] = np.where(np.isinf(each), 0.0, each)
        # With fewer periods than parts, some parts have none and keep the values before.
        filled = np.unique(np.arange(len(self._references)) * PARTS // len(self._references))
        over_time = self._over_time[:, filled[np.searchsorted(filled, np.arange(PARTS), side="right") - 1]]
        over_time[..., 0], over_time[..., 1] = np.sqrt(over_time[..., 0]), -over_time[..., 1]
        result["over_time"] = np.where(np.isinf(over_time), np.nan, over_time)
        result["exceeded"] = np.maximum(((self._most - self._t_max) / self._range).max(axis=1), 0.0)
        return result
