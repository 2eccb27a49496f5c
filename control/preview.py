"""What a predictive controller looks ahead to: `Preview`, the references of its stages; `rows_at`, between others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.errors import InputError
from ..base.inputs import number, shown
from .carrier_references import Moved
from .reference import Reference

__all__ = ["Preview", "rows_at", "turns"]

ROUNDING = 1e-9  # of a period
CLOSE = 1e-5  # [m, rad] by which a reference may differ from the one that was announced


class Preview:
    """References of the times to come, at the beginning of each stage and at the end of the last.

    Parameters
    ----------
    steps
        How long stages last, (N,) [s].
    moved
        Coordinates of carriers that a solution moves.
    tensions
        Those of a reference that has none, (m,) [N].
    """

    def __init__(self, steps: np.ndarray, moved: Moved, tensions: np.ndarray):
        self._steps, self._moved, self._unknown = steps, moved, tensions
        self._times = np.concatenate([[0.0], np.cumsum(steps)])
        self.reset()

    def reset(self) -> None:
        """Forget what was announced."""
        self._announced: tuple[float, float, tuple[np.ndarray, ...]] | None = None

    def follow(self, references: Sequence[Reference], period: float, start: float) -> None:
        """Receive references, one for each period from `start` on [s].

        Raises
        ------
        InputError
            If an argument has a wrong type or value.
        """
        if (
            not isinstance(references, Sequence)
            or not references
            or not all(isinstance(r, Reference) for r in references)
        ):
            raise InputError(f"references must be a list of References, got {shown(references)}")
        period, start = number("period", period, 1e-9, 1e6), number("start", start, -1e9, 1e9)
        self._announced = start, period, self.rows(references)

    def rows(self, references: Sequence[Reference]) -> tuple[np.ndarray, ...]:
        """Return platforms (K, 3, 6), carriers (K, c, 3, 6), moved coordinates (K, 3, f) and tensions (K, m)."""
        platform = np.array([reference[:3] for reference in references])
        carriers = np.stack([np.stack(reference[3:6], axis=1) for reference in references])
        if len(references) > 1:
            platform[:, 0, 3:] = np.unwrap(platform[:, 0, 3:], axis=0)
            carriers[:, :, 0, 3:] = np.unwrap(carriers[:, :, 0, 3:], axis=0)
        tensions = [
            self._unknown if each.tensions is None else np.asarray(each.tensions, dtype=float) for each in references
        ]
        return platform, carriers, self._moved.along(platform, carriers), np.stack(tensions)

    def at(
        self, time: float, now: tuple[np.ndarray, ...], attitude: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return states (N + 1, n), carriers (N + 1, c, 12) and controls (N + 1, u) of the reference at all stages.

        It is the one that was announced, if that has this reference now. Beyond it accelerations stay. The last result
        is what the ramps of its accelerations add to states within each stage, (N, n): a control is held for a stage in
        the model and for a period in fact, so that without them it would give the mean of the stage, half a stage
        early.
        """
        parts = None
        if self._announced is not None:
            start, period, rows = self._announced
            steps = (time + self._times - start) / period
            before = np.clip(np.floor(steps + ROUNDING), 0, len(rows[0]) - 1).astype(int)
            announced = rows_at(rows, period * (steps - before), before, period)
            off = announced[0][0, 0] - now[0][0, 0]
            off[3:] -= turns(off[3:])
            if np.abs(off).max() <= CLOSE:
                parts = announced
        if parts is None:
            parts = rows_at(now, self._times, np.zeros(len(self._times), dtype=int), 1.0)
        platform, carriers, moved, tensions = parts
        states = np.concatenate([platform[:, 0], platform[:, 1], moved[:, 0], moved[:, 1]], axis=1)
        states[:, 3:6] += turns(attitude - states[0, 3:6])
        ramp, dt = np.diff(np.concatenate([platform[:, 2], moved[:, 2]], axis=1), axis=0), self._steps[:, None]
        further, faster = dt * dt / 6 * ramp, dt / 2 * ramp
        ramps = np.concatenate([further[:, :6], faster[:, :6], further[:, 6:], faster[:, 6:]], axis=1)
        controls = np.concatenate([tensions, moved[:, 2]], axis=1)
        still = np.ascontiguousarray(carriers[:, :, :2]).reshape(len(states), -1, 12)  # poses and velocities
        return states, still, controls, ramps


def turns(off: np.ndarray) -> np.ndarray:
    """Return the whole turns that are nearest to differences of angles [rad]."""
    return 2 * np.pi * np.rint(off / (2 * np.pi))


def rows_at(
    rows: tuple[np.ndarray, ...], after: np.ndarray, before: np.ndarray, period: float
) -> tuple[np.ndarray, ...]:
    """Return references at times between those that are known.

    Between two of them accelerations and tensions change evenly; beyond the last one accelerations stay.

    Parameters
    ----------
    rows
        Platforms (K, 3, 6), carriers (K, c, 3, 6) and moved coordinates (K, 3, f), each place, rate and acceleration,
        and tensions (K, m) [N].
    after
        How long after a row each time is, (N,) [s].
    before
        The number of that row, (N,).
    period
        From one row to the next [s].
    """
    if np.abs(after).max() <= ROUNDING * period:
        return tuple(part[before] for part in rows)
    following = np.minimum(before + 1, len(rows[0]) - 1)
    result = []
    for part in rows[:3]:
        t, motion = after.reshape(-1, *[1] * (part.ndim - 2)), part[before]
        rate, acceleration = motion[..., 1, :], motion[..., 2, :]
        change = t / period * (part[following][..., 2, :] - acceleration)
        motion[..., 0, :] += t * (rate + t / 2 * (acceleration + change / 3))
        rate += t * (acceleration + change / 2)
        acceleration += change
        result.append(motion)
    last = rows[3][before]
    return *result, last + after[:, None] / period * (rows[3][following] - last)
