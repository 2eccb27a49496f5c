"""`lengths_of`: cable lengths from readings; `locked`, `unrolled`: readings that hardly change, or begin again."""

import numpy as np

from ...models.robot import Robot

LOCKED = 1e-4  # of a length, by which noise may change the reading of a locked winch
RETURNED = 2.0  # times the largest usual step, from a usual period, of a counter that jumps forth and back at once
ROLLED, END = 0.9, 0.05  # of the range of readings: a jump from one end to the other, and what is near an end
PERIODS = (*(2.0**k for k in range(8, 33)), 360.0, 2 * np.pi)  # of counters, and of angles in deg and rad


def lengths_of(robot: Robot, readings: np.ndarray, tensions: np.ndarray | None = None) -> np.ndarray:
    """Return cable lengths (..., m) [m] of readings, by the encoders of the file, under tensions [N] where measured."""
    offset, scale, build_up = robot.encoders.T
    return (offset + (scale + build_up * readings) * readings) * stretched(robot, tensions)


def stretched(robot: Robot, tensions: np.ndarray | None) -> np.ndarray | float:
    """Return lengths over unstrained lengths, (..., m), of cables with a stiffness under tensions [N], or 1."""
    by = np.array([1 / cable.stiffness if cable.stiffness else 0.0 for cable in robot.cables])
    return 1.0 if tensions is None else 1 + np.maximum(tensions, 0.0) * by


def readings_of(robot: Robot, lengths: np.ndarray) -> np.ndarray:
    """Return readings of the winches (..., m) at unstrained cable lengths (..., m) [m]: the reverse of `lengths_of`."""
    offset, scale, build_up = robot.encoders.T
    root = np.sqrt(np.maximum(scale**2 + 4 * build_up * (lengths - offset), 0.0))
    return 2 * (lengths - offset) / (scale + np.copysign(root, scale))


def locked(lengths: np.ndarray, most: float = LOCKED) -> bool:
    """Return whether readings (N, m) hardly change, by a share `most` of their size, as with locked winches."""
    known = lengths[np.isfinite(lengths).all(axis=1)]
    return len(known) > 1 and bool((np.ptp(known, axis=0) <= most * np.abs(known).max(axis=0)).all())


def unrolled(readings: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Return readings (N, m) without the jumps of counters and angles that begin again, and the columns that had some.

    These go from one end of their range to the other in one step, always by the same amount, while another one moves
    on. A single jump shows a usual period.
    """
    result, rolled = readings, list[int]()
    known = np.where(np.isfinite(readings), readings, np.nan)
    ranges = np.nanmax(known, axis=0, initial=-np.inf) - np.nanmin(known, axis=0, initial=np.inf)
    for i, column in enumerate(readings.T):
        rows = np.flatnonzero(np.isfinite(column))
        y, steps = column[rows], np.diff(column[rows])
        whole = float(np.ptp(y)) if len(y) > 2 else 0.0
        jumps = np.flatnonzero(np.abs(steps) > ROLLED * whole)
        smooth = np.delete(steps, jumps)
        missing = not (y[jumps] * y[jumps + 1]).any()  # readings, which are zeros
        if missing or not smooth.size or np.abs(smooth).max() > END * whole:
            continue
        around = 0.5 * (steps[np.maximum(jumps - 1, 0)] + steps[np.minimum(jumps + 1, len(steps) - 1)])
        periods = np.abs(steps[jumps] - np.where(np.abs(around) > END * whole, 0.0, around))
        others = np.delete(np.abs(known[rows[jumps + 1]] - known[rows[jumps]]) - END * ranges, i, axis=1)
        moves_on = not (others > 0).all(axis=1).any() or readings.shape[1] == 1  # the platform does not jump
        if np.ptp(periods) <= END * whole and moves_on:
            period = float(np.median(periods))
            nearest = min(PERIODS, key=lambda one: abs(one - period))
            usual = abs(nearest - period) <= END * period
            if not usual and len(jumps) == 1:
                continue
            if (np.diff(jumps) == 1).any() and abs(nearest - period) > RETURNED * np.abs(smooth).max():
                continue  # a single wrong reading
            result = result if rolled else readings.copy()
            result[rows, i] = np.unwrap(y, period=nearest if usual else period)
            rolled.append(i)
    return result, rolled
