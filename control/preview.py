"""The future references of a predictive controller: `Preview`, one for each stage; `rows_at` interpolates."""

from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from ..base.inputs import InputError, number, shown
from ..models.rigid_load import RigidLoad
from ..models.robot import Robot
from .as_floats import as_floats
from .carrier_references import Moved
from .controller import Reference

ROUNDING = 1e-9  # of a period
STEEPEST = 1.5  # [rad]: near a pitch of 90 degrees roll and yaw change so fast that no linear model is right
CLOSE = 1e-5  # [m, rad] by which a reference may differ from the one that was announced


class Rows(NamedTuple):
    """References, a row each."""

    motions: np.ndarray  # position, rate and acceleration of platform, carriers and moved coordinates, (K, 3, d)
    tensions: np.ndarray  # (K, m) [N]
    loads: list[RigidLoad | None]


class Preview:
    """Future references, at the beginning of each stage and at the end of the last.

    - `robot`: the robot.
    - `tensions`: tensions for a reference without tensions, (m,) [N].

    Raises `InputError` if the platform pitches so far at home that its angles are no coordinates.
    """

    def __init__(self, robot: Robot, tensions: np.ndarray):
        if not abs(pitch := float(robot.home[4])) <= STEEPEST:
            must = f"the pitch at home must be from -{STEEPEST} to {STEEPEST} rad for predictive control"
            raise InputError(f"{must}, got {pitch:g} rad; other axes of the platform's frame avoid it")
        self._robot, self._unknown = robot, tensions
        self.reset()

    def lay_out(self, steps: np.ndarray, moved: Moved) -> None:
        """Set the durations of the stages, (N,) [s], and the coordinates of carriers that a solution moves."""
        self._moved, self._times = moved, np.concatenate([[0.0], np.cumsum(steps)])
        self._half, self._sixth = steps[:, None] / 2, steps[:, None] ** 2 / 6

    @property
    def period(self) -> float:
        """Return the period of the announced references [s], or 0."""
        return 0.0 if self._announced is None else self._announced[1]

    def reset(self) -> None:
        """Forget the announced references."""
        self._announced: tuple[float, float, Rows] | None = None

    def follow(self, references: Sequence[Reference], period: float, start: float) -> None:
        """Receive references, one for each period, from `start` [s] on.

        Raises `InputError` if an argument has a wrong type or value.
        """
        is_list = isinstance(references, Sequence) and all(isinstance(each, Reference) for each in references)
        if not (is_list and references):
            raise InputError(f"references must be a list of References, got {shown(references)}")
        period, start = number("period", period, 1e-9, 1e6), number("start", start, -1e9, 1e9)
        with np.errstate(invalid="ignore"):  # of angles that are infinite: the step holds what it has
            self._announced = start, period, self.rows([as_floats(each, self._robot, None) for each in references])

    def rows(self, references: Sequence[Reference]) -> Rows:
        """Return references as rows; motions are (K, 3, 6 + 6 c + f)."""
        count, carriers = len(references), 6 * len(references[0][3])
        motions = np.empty((count, 3, 6 + carriers + self._moved.count))
        for row, reference in zip(motions, references, strict=True):
            row[:, :6], row[:, 6 : 6 + carriers] = reference[:3], np.reshape(reference[3:6], (3, carriers))
        platform, of_carriers = motions[..., :6], motions[..., 6 : 6 + carriers].reshape(count, 3, -1, 6)
        if count > 1:
            platform[:, 0, 3:] = np.unwrap(platform[:, 0, 3:], axis=0)
            of_carriers[:, 0, :, 3:] = np.unwrap(of_carriers[:, 0, :, 3:], axis=0)
            motions[:, 0, 6 : 6 + carriers] = of_carriers[:, 0].reshape(count, -1)
        self._moved.recentre(platform, of_carriers.swapaxes(1, 2))
        if self._announced is not None and self._tethers is not self._moved.tethers:
            self._set_moved(self._announced[2].motions)
        self._tethers = self._moved.tethers  # of the coordinates in announced references
        self._set_moved(motions)
        tensions = [self._unknown if each.tensions is None else each.tensions for each in references]
        return Rows(motions, np.array(tensions, dtype=float), [each.load for each in references])

    def _set_moved(self, motions: np.ndarray) -> None:
        """Write the moved coordinates of motions, (K, 3, 6 + 6 c + f)."""
        bodies = motions[..., : motions.shape[2] - self._moved.count].reshape(len(motions), 3, -1, 6).swapaxes(1, 2)
        motions[..., motions.shape[2] - self._moved.count :] = self._moved.along(bodies[:, 0], bodies[:, 1:])

    def moved_of(self, rows: Rows) -> np.ndarray:
        """Return position, rate and acceleration of the moved coordinates in the first row, (3, f)."""
        return rows.motions[0, :, rows.motions.shape[2] - self._moved.count :]

    def at(
        self, time: float, now: Rows, attitude: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, list[tuple[RigidLoad | None, slice]]]:
        """Return states (N + 1, n), carriers (N + 1, c, 12) and controls (N + 1, u) of the reference at all stages.

        The announced reference is used if it agrees with the current one; after its end accelerations are constant. The
        fourth result is the effect of the change of its acceleration on the states
        within each stage, (N, n): the model holds a control for a whole stage, the robot only for a period, so without
        it the control would be the mean over the stage, half a stage early. The last are the loads, each with stages:
        the current one until the announced ones change.
        """
        rows, before, after, period = self._chosen(time, now)
        motions, tensions = rows_at(rows, after, before, period)
        runs = [list(run) for _, run in groupby(range(len(before) - 1), lambda stage: rows.loads[before[stage]])]
        loads = [(rows.loads[before[run[0]]] if run[0] else now.loads[0], slice(run[0], run[-1] + 1)) for run in runs]
        place, rate, acceleration = motions.swapaxes(0, 1)
        moved = motions.shape[2] - self._moved.count
        states = np.concatenate([place[:, :6], rate[:, :6], place[:, moved:], rate[:, moved:]], axis=1)
        states[:, 3:6] += turns(attitude - states[0, 3:6])
        ramp = acceleration[1:] - acceleration[:-1]
        further, faster = self._sixth * ramp, self._half * ramp
        ramps = np.concatenate([further[:, :6], faster[:, :6], further[:, moved:], faster[:, moved:]], axis=1)
        controls = np.concatenate([tensions, acceleration[:, moved:]], axis=1)
        carriers = motions[:, :2, 6:moved].reshape(len(states), 2, -1, 6)
        return states, carriers.swapaxes(1, 2).reshape(len(states), -1, 12), controls, ramps, loads

    def _chosen(self, time: float, now: Rows) -> tuple[Rows, np.ndarray, np.ndarray, float]:
        """Return the announced references, or the current one if they differ, and which of them precede the stages.

        The other results are the times since these, (N + 1,) [s], and the period of the references [s].
        """
        if self._announced is not None:
            start, period, rows = self._announced
            steps = (time + self._times - start) / period
            before = np.clip(np.floor(steps + ROUNDING), 0, len(rows.loads) - 1).astype(int)
            after = period * (steps - before)
            off = rows_at(rows, after[:1], before[:1], period)[0][0, 0, :6] - now.motions[0, 0, :6]
            off[3:] -= turns(off[3:])
            if np.abs(off).max() <= CLOSE:
                return rows, before, after, period
        return now, np.zeros(len(self._times), dtype=int), self._times, 1.0


def turns(off: np.ndarray) -> np.ndarray:
    """Return the multiples of a full turn closest to differences of angles [rad]."""
    return 2 * np.pi * np.rint(off / (2 * np.pi))


def later(rows: np.ndarray, steps: float) -> np.ndarray:
    """Return rows, (K, ...), of a number of `steps` later, interpolated linearly; after the last one it stays."""
    first = np.minimum(np.arange(len(rows)) + int(steps), len(rows) - 1)
    second, share = np.minimum(first + 1, len(rows) - 1), steps - int(steps)
    return (1 - share) * rows[first] + share * rows[second]


def rows_at(rows: Rows, after: np.ndarray, before: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate references every `period` [s]: return motions (N, 3, d) and tensions (N, m).

    The results are those at times `after`, (N,) [s], the rows `before`, (N,). Accelerations and tensions are
    interpolated linearly; after the last reference accelerations are constant.
    """
    motions, tensions = rows[:2]
    motion, last = motions[before], tensions[before]
    if np.abs(after).max() <= ROUNDING * period:
        return motion, last
    following, t = np.minimum(before + 1, len(motions) - 1), after[:, None]
    place, rate, acceleration = motion.swapaxes(0, 1)
    change = t / period * (motions[following, 2] - acceleration)
    place += t * (rate + t / 2 * (acceleration + change / 3))
    rate += t * (acceleration + change / 2)
    acceleration += change
    return motion, last + t / period * (tensions[following] - last)
