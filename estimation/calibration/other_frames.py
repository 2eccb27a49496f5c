"""`in_other_frames`, `displaced`: frames of measured poses that explain the differences of a log.

If nothing else explains the differences, poses may have been measured in another frame, or of another body
(`frames`). Such a frame near the file's is named, but not refused, if it explains most of the differences up to an
offset.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ...base.text import counted
from ...models.part import LARGEST
from ..logs.measurements import Measurements, measured_poses
from .differences import AS_GIVEN, FEWEST, PLAUSIBLE, LogPart, medians
from .explanations import VERY_CLEARLY, Way, explanations, is_noise, rms, with_order
from .frames import Frames, displaced_frames, fitted_frames, fitted_orders, in_convention
from .geometry import length_of
from .input_errors import Mistake, Placed, better_by, corrected_to
from .interpretations import Interpretation
from .unexplained import FAR, Unexplained, aligned

MANY_CABLES = 6  # of fewer cables, frames explain what wrong anchors do
DISPLACED = 3.0  # times smaller differences, by a frame near the file's
SCALED = 2  # fits of frames with the scales of readings that were found with the frames before


class _Framed(NamedTuple):
    """Frames with a convention of angles, the explanation of what they leave, and the poses of all samples in them."""

    frames: Frames
    read: Interpretation
    way: Way
    placed: Placed


def in_other_frames(log: Unexplained) -> Mistake | None:
    """Return other frames of the poses that explain the differences, with an order and scales of the readings."""
    given = np.arange(log.robot.m)
    for order, rivals in [(given, 0)] if log.still else _orders(log.log):
        for found in _tried(log, order):
            if found.way.weighted * found.way.way.factor < min(log.as_given, log.left) and found.way.size < log.most:
                return _of_frames(log, order, rivals, found)
    return None


def _orders(log: LogPart) -> Iterator[tuple[np.ndarray, int]]:
    """Yield the order of the readings as given, and that in which frames fit best, with how many fit as well."""
    given = np.arange(log.robot.m)
    yield given, 0
    first, *others = fitted_orders(log)
    if (first != given).any():
        yield first, len(others)


def _tried(log: Unexplained, order: np.ndarray) -> Iterator[_Framed]:
    """Yield frames for readings in an order as they are, and then with a scale for each cable.

    With scales that are known, the frames are near those before, and found more exactly.
    """
    ordered = log.log._replace(y=log.log.y[:, order])
    frames, read = _fitted(log, ordered)
    moved, there, left = _placed(log, ordered, frames, read)
    # Speeds show the clock in the right frame only, which is not the one of readings in another unit.
    if not is_noise(there, left) and np.abs(moved[0]).max() < LARGEST:
        whole = corrected_to(log.given, moved, order, 1.0)
        there, left = (aligned(log.robot, whole, log.rows, log.table) or there).sound()
    yield _Framed(frames, read, _as_they_are(there, left), moved)
    if log.still:
        return
    frames, read = _fitted(log, ordered._replace(counted=True))
    for step in range(SCALED + 1):
        moved, there, left = _placed(log, ordered, frames, read)
        way = _with_scales(log, there, left)
        if frames.size > FAR * log.most * way.way.factor:  # with any scales
            return
        if step == SCALED:
            yield _Framed(frames, read, way, moved)
            return
        scaled = ordered.y[:, way.columns] * way.signs * way.way.factor
        part = ordered._replace(y=scaled, rotation=ordered.at(read)[1], counted=False)
        frames = fitted_frames(part, frames, FAR * log.noise)


def _fitted(log: Unexplained, part: LogPart) -> tuple[Frames, Interpretation]:
    """Return the frames that fit best, with another convention of angles if they leave much."""
    frames = fitted_frames(part)
    # With one angle, other conventions would fit.
    turns = bool(np.ptp(log.log.angles, axis=0).any()) and log.robot.dof_mask.sum() == 6
    return in_convention(part, frames) if turns and frames.size > FAR * log.noise else (frames, AS_GIVEN)


def _placed(
    log: Unexplained, part: LogPart, frames: Frames, read: Interpretation
) -> tuple[Placed, LogPart, np.ndarray]:
    """Return the poses of all samples in frames, and the sound samples of a part there with their differences."""
    moved = frames.of(log.whole.position, log.whole.at(read)[1])
    placed = frames.of(part.position, part.at(read)[1])
    return (*moved, None), *part._replace(position=placed[0], rotation=placed[1]).sound()


def _as_they_are(log: LogPart, e: np.ndarray) -> Way:
    """Return the explanation of differences by frames alone."""
    size, order = rms(medians(e, len(log.y))), np.arange(log.robot.m)
    return Way(VERY_CLEARLY * size, size, "", AS_GIVEN, order, np.ones(log.robot.m))


def _with_scales(log: Unexplained, there: LogPart, e: np.ndarray) -> Way:
    """Return the best explanation of what frames leave by the readings: their units, signs, order or scales."""
    ways = explanations(there, e[:, : len(there.y)], log.noise)[0]
    of_readings = (one for one in ways if one.way.of_readings)
    return min(of_readings, default=_as_they_are(there, e), key=lambda one: one.weighted)


def _of_frames(log: Unexplained, order: np.ndarray, rivals: int, found: _Framed) -> Mistake:
    """Return the error that frames explain; it is not corrected if other orders explain as much."""
    frames, read, way, placed = found
    given, same = np.arange(log.robot.m), np.ones(log.robot.m)
    texts = with_order("", order, same), way.text, read.text, better_by(str(frames), log.as_given, way.size)
    text = ", and ".join(filter(None, texts))
    if rivals:
        return Mistake(f"{text}; but {counted(rivals, 'other order')} in other frames fit as well", None)
    if not log.still and (order == given).all() and len(frames.found) > 1:
        better = fitted_orders(log.log)
        if not any((one == order[way.columns]).all() for one in better):
            other = with_order("", better[0], same)
            return Mistake(f"{text}; or {other}, in other frames that are simpler or fit better", None)
    factors = way.signs * way.way.factor
    columns = order[way.columns]
    corrected = corrected_to(log.given, placed, columns, factors, frames.found)
    return Mistake(text, corrected, factors=factors, columns=columns)


def displaced(log: LogPart, given: Measurements, noise: float) -> Mistake | None:
    """Return a frame near the file's in which the poses agree much better with the readings up to offsets, or None.

    It is an input error if, of another body, it would move the ends of cables farther than a file may be wrong.
    """
    robot = log.robot
    if len(log.y) < FEWEST[1]:
        return None
    found = displaced_frames(log, DISPLACED, noise)
    if found is None:
        return None
    frames, before = min(found[0], fitted_frames(log), key=lambda one: one.size), found[1]
    if robot.m <= MANY_CABLES and before < DISPLACED**2 * max(frames.size, noise):
        placed = frames.of(log.position, log.rotation)
        logs = log, log._replace(position=placed[0], rotation=placed[1])
        sizes = [rms(medians(one.sound(0)[1], len(one.y))) for one in logs]
        if sizes[0] < VERY_CLEARLY * sizes[1]:
            return None  # displaced ends of cables are as plausible
    position, rotation, _ = measured_poses(robot, given)
    corrected = corrected_to(given, (*frames.of(position, rotation), None), np.arange(robot.m), 1.0, frames.found)
    shift, turn = frames.inner
    moved = np.linalg.norm(robot.attachments @ (turn - np.eye(3)).T + shift, axis=1).max()
    severe = bool(moved > PLAUSIBLE * length_of(robot))
    return Mistake(better_by(str(frames), before, frames.size), corrected, severe)
