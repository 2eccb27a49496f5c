"""`unreadable`: tensions of dead or saturated sensors; `slack`: cables that are longer than the way to the platform."""

from collections.abc import Iterator

import numpy as np

from ...base.text import quantity
from ...models.robot import Robot
from .measurements import Measurements

FEWEST = 6  # equal samples that are not due to chance
LEVELS, RARE = 3, 5.0  # values compared with the largest one, and how many times rarer they are if it is a saturation
MOVES = 0.2  # of the usual change of the lengths from sample to sample, below which the platform rests
NO_TENSION = 3.0  # standard deviations of the mean tension, below which a cable may be slack
SAME = 1e-9  # of the largest tension, by which equal ones differ after interpolation


def unreadable(tensions: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return which tensions (N, m) [N] are not measurements, (N, m) of bool, for lengths (N, m) [m].

    All tensions of a dead sensor are equal. While lengths change, a saturated sensor has its largest value much more
    often than the values just below it; a sensor that is only quantised has all of these about equally often.
    """
    result = np.zeros(tensions.shape, dtype=bool)
    if len(tensions) < FEWEST:
        return result
    same = SAME * np.abs(tensions).max()
    dead = np.ptp(tensions, axis=0) <= same
    if not dead.all():  # otherwise the tensions are those of commands or of a platform at rest
        result[:, dead] = True
    steps = np.abs(np.diff(lengths, axis=0, prepend=lengths[1:2])).max(axis=1)
    moving = steps > MOVES * np.median(steps)
    for y, saturated in zip(tensions[:, ~dead].T, np.flatnonzero(~dead), strict=True):
        top = y >= y.max() - same
        below, counts = y[~top], []
        while below.size and len(counts) < LEVELS:
            level = below >= below.max() - same
            counts.append(np.count_nonzero(level))
            below = below[~level]
        if np.count_nonzero(top & moving) >= max(FEWEST, RARE * np.mean(counts)):
            result[:, saturated] = top
    return result


def slack(robot: Robot, measurements: Measurements) -> np.ndarray:
    """Return which cables seem slack by their tensions, (N, m) of bool; those from thrusts are too uncertain."""
    tensions = measurements.tensions
    if tensions is None or any(carrier.actuators for carrier in robot.carriers):
        return np.zeros(measurements.lengths.shape, dtype=bool)
    least = NO_TENSION * measurements.sigma.tensions * np.abs(tensions).mean()
    return (tensions < least) & ~unreadable(tensions, measurements.lengths)


def notes(tensions: np.ndarray, lengths: np.ndarray) -> Iterator[str]:
    """Yield a line for dead sensors, and one for each saturated sensor, of tensions (N, m) [N] and lengths (N, m)."""
    wrong = unreadable(tensions, lengths)
    dead = np.flatnonzero(wrong.all(axis=0))
    if dead.size:
        names = ", ".join(f"cables[{i}]" for i in dead)
        yield f"tensions of {names} never change, so they are treated as not measured"
    for i in np.flatnonzero(wrong.any(axis=0) & ~wrong.all(axis=0)):
        count, most = quantity(int(wrong[:, i].sum())), quantity(float(tensions[:, i].max()), "N", 3)
        yield f"the tension of cables[{i}] seems saturated at {most}: {count} samples are treated as not measured"
