"""`representative`: the samples of a long log that are used, which tell nearly as much as all.

The others would only reduce the effect of noise, which is small beside errors of the model in so many samples.
"""

from warnings import catch_warnings

import numpy as np

from ...models.robot import Robot
from ..logs.measurements import Measurements
from ..logs.smoothing import ROUGHER, roughness
from .balance import hangs
from .motion import SLOWEST

MANY = 100_000  # samples of a log, of which all are used
LEAST = 0.5  # of the stated standard deviations: a smaller noise does not matter
BLOCKS, BLOCK = 20, 1000  # of successive samples where forces count, which take far longer
CHANCE = 4.0  # standard deviations of a ratio of roughnesses, at most 1 / sqrt(n) each
MEASURED = 0.5  # of the samples: values that are missing more often do not show the motion
RESTING = 25  # successive samples with hardly different readings, which are a part of a rest
MATTERS = 0.1  # of a log: shorter rests, or a shorter motion, do not
THIN = 10  # samples apart, those that show what a block is like


def representative(robot: Robot, measurements: Measurements) -> np.ndarray | None:
    """Return the samples of a log with times that are used, (k,), or None if all are.

    Of an oversampled log, these are equally many samples apart. If tensions were measured, or weight determines them,
    blocks of successive ones of these suffice.
    """
    count = len(measurements)
    if measurements.times is None:
        return None
    rows = np.arange(0, count, _spacing(robot, measurements)) if count > MANY else np.arange(count)
    if len(rows) > 2 * BLOCKS * BLOCK and (measurements.tensions is not None or hangs(robot, measurements)):
        rows = rows[_blocks(measurements.only(rows))]
    return rows if len(rows) < count else None


def of_motion(measurements: Measurements) -> np.ndarray:
    """Return the samples in motion and the first one of each rest, (k,); all if rests are too short to matter.

    However long a rest is, its readings are one statement about the geometry. All samples are also returned if there is
    hardly any motion.
    """
    every = np.arange(len(measurements))
    whole = len(every) // RESTING
    if measurements.times is None or not whole:
        return every
    blocks = measurements.lengths[: whole * RESTING].reshape(whole, RESTING, -1)
    rests = (blocks.std(axis=1) < measurements.sigma.lengths).all(axis=1)
    if not MATTERS < rests.mean() < 1 - MATTERS:
        return every
    used = np.repeat(~rests, RESTING)
    used[RESTING * np.flatnonzero(np.diff(rests, prepend=False) & rests)] = True
    return np.append(np.flatnonzero(used), every[len(used) :])


def _blocks(log: Measurements) -> np.ndarray:
    """Return the samples of blocks, (k,): half of these are spread over a log, and half differ most from the others.

    Otherwise a motion between long rests, for example, or another load might be missed.
    """
    whole, given = len(log) // BLOCK, [one for one in (log.lengths, log.poses, log.tensions) if one is not None]
    values = np.dstack([one[: whole * BLOCK].reshape(whole, BLOCK, -1)[:, ::THIN] for one in given])
    with catch_warnings(action="ignore", category=RuntimeWarning):  # blocks without a value of a column
        shown = np.hstack(list(np.nanquantile(values, (0.1, 0.5, 0.9), axis=1)))  # wrong readings are few
        low, high = np.nanmin(shown, axis=0), np.nanmax(shown, axis=0)
    shown = np.nan_to_num((shown - low) / np.maximum(high - low, 1e-12))
    chosen = np.linspace(0, whole - 1, BLOCKS // 2).astype(int)
    while len(chosen) < BLOCKS:
        apart = np.linalg.norm(shown[:, None] - shown[chosen], axis=2).min(axis=1)  # (whole,)
        apart[chosen] = -1.0
        chosen = np.append(chosen, np.argmax(apart))
    return (np.sort(chosen)[:, None] * BLOCK + np.arange(BLOCK)).ravel()


def _spacing(robot: Robot, measurements: Measurements) -> int:
    """Return n if every n-th sample shows the motion of a long log, also between these samples.

    Parabolas through neighbours that are twice as far apart then hardly deviate from them, compared with the noise.
    """
    some, given = measurements.only(_blocks(measurements)), measurements.sigma
    assert some.times is not None
    arm = max(float(np.linalg.norm(robot.attachments, axis=1).max()), 1e-9)
    of_pose = np.repeat([given.lengths, given.lengths / arm], 3)
    of_tension = np.zeros(0) if some.tensions is None else given.tensions * np.abs(some.tensions).mean(axis=0)
    sizes = np.full(robot.m, given.lengths), of_pose, of_tension, np.tile(of_pose, len(robot.carriers))
    values = some.lengths, some.poses, some.tensions, some.carrier_poses
    pairs = [(one.reshape(len(some), -1), size) for one, size in zip(values, sizes, strict=True) if one is not None]
    each, stated = map(np.hstack, zip(*pairs, strict=True))
    known = np.isfinite(each).mean(axis=0) > MEASURED
    rows = np.isfinite(each[:, known]).all(axis=1)
    if rows.mean() < MEASURED:
        return 1
    each, times = each[rows][:, known], some.times[rows]
    # Readings that are interpolated at the times of another sensor hide a part of their noise from their neighbours.
    between = (roughness(times[::n], each[::n], moving=True) for n in (1, 2))
    usual = np.maximum(LEAST * stated[known], np.max([*between], axis=0))
    wanted = min(-(-len(measurements) // MANY), int(SLOWEST / np.median(np.diff(some.times))))
    for n in range(wanted, 1, -1):
        fewer = slice(None, None, 2 * n)
        most = ROUGHER + CHANCE / np.sqrt(len(each[fewer]))
        if (roughness(times[fewer], each[fewer], moving=True) <= most * usual).all():
            return n
    return 1
