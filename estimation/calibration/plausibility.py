"""`mistake`: detect input errors of a log before the fit, which would hide them in wrong parameters, and mend them.

With the right order of cables, units and convention of angles, the difference between a cable's length at the measured
poses and its reading hardly changes: it is the offset plus the effect of a displaced anchor. So other interpretations
of the log are tried, with the order of cables that has the smallest differences (an assignment problem). An error is
named if the differences become much smaller without it. If they are already as small as the stated standard deviation,
nothing is tried.

If nothing explains the differences, poses may have been measured in another frame, or of another body
(`other_frames`).
"""

import numpy as np

from ...base.text import quantity
from ...models.files import as_robot
from ...models.robot import Robot
from ..logs.measurements import Measurements, check_measurements, measured, tracked
from .attitudes import misread_attitudes
from .differences import FEWEST
from .explanations import BY_CHANCE, explanations, is_noise
from .geometry import length_of
from .interpretations import FACTORS
from .other_frames import Mistake, Unexplained, aligned, better_by, corrected_to, displaced, in_other_frames, part_of
from .parameters import Parameters

DECISIVELY = 1.5  # times smaller differences
MOST_SAMPLES = 400
LARGEST = 10.0  # times the cables' mean length, of a change of readings


def mistake(robot: Robot, measurements: Measurements) -> Mistake | None:
    """Detect the probable input error of a log by the robot's file, before any fit; None if there is none.

    Raises `InputError` if the measurements have another number of cables.
    """
    robot = as_robot(robot)
    given = check_measurements(robot, measurements)
    parameters = Parameters(robot, ())
    table = parameters.table(parameters.first)
    rows = np.flatnonzero(tracked(robot, given))
    if len(rows) < 4:
        large = _too_large(robot, given, given.lengths * table[:, 7])
        return large or misread_attitudes(robot, given)
    known = measured(given)
    framed = given.carrier_poses is None and bool((known.any(axis=0) | (robot.dof_mask == 0))[3:].all())
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), MOST_SAMPLES)).astype(int)]
    log, e = part_of(robot, given.only(rows), table).steady().sound()
    if not is_noise(log, e) and (by_speeds := aligned(robot, given, rows, table)) is not None:
        log, e = by_speeds.sound()
    e = e[:, : len(log.y)]
    noise = log.sigma * np.sqrt(1 + BY_CHANCE * np.sqrt(2 / e.size))
    if not is_noise(log, e):
        open_ = Unexplained(robot, given, table, rows, log, noise, *explanations(log, e, noise))
        in_frames = in_other_frames(open_) if open_.far and framed and len(log.y) >= FEWEST[1] else None
        if in_frames or open_.named:
            return in_frames or _without_frames(open_)
        framed = framed and not open_.far
    return displaced(log, given, noise) if framed else None


def _without_frames(log: Unexplained) -> Mistake:
    """Return the error that explains the differences best without other frames."""
    best = log.best
    factors = best.signs * best.way.factor
    # Fitted scales reduce the differences of any log; the remainder may be due to a wrong explanation.
    rival = min((way for way in log.ways if way.text not in ("", best.text)), default=best, key=lambda way: way[:2])
    fitted = best.way.factor not in (1.0, *FACTORS)
    open_ = log.far and fitted and best is not rival and rival.weighted < DECISIVELY * best.weighted
    text = better_by(best.text, log.as_given, best.size)
    if open_:
        text = f"{text}; but something else explains them nearly as well: {rival.text}"
    several = best.several or open_
    corrected = None if several else corrected_to(log.given, log.whole.at(best.way), best.columns, factors)
    return Mistake(text, corrected, factors=factors, columns=best.columns)


def _too_large(robot: Robot, given: Measurements, readings: np.ndarray) -> Mistake | None:
    """Return the error if readings (N, m) change more than any cable of the robot can, or None."""
    length = length_of(robot)
    change = float(np.median(np.ptp(readings, axis=0)))
    if change <= LARGEST * length:
        return None
    factor = next((one for one in FACTORS if one * change <= LARGEST * length), None)
    unit = FACTORS[factor] if factor else "counts, whose size is not given"
    by, long = (quantity(one, "m", digits=3) for one in (change, length))
    text = f"the lengths look like {unit}: they change by {by}, and a cable of {robot.name} is about {long} long"
    corrected = given.changed(lengths=given.lengths * factor) if factor else None
    return Mistake(text, corrected, factors=factor or 1.0)
