"""`in_other_frames`, `displaced`: frames of measured poses that explain the differences of a log.

If nothing else explains the differences, poses may have been measured in another frame, or of another body
(`frames`). Such a frame near the file's is named, but not refused, if it explains most of the differences up to an
offset. `Unexplained` are differences that are no noise, and a `Mistake` is what probably explains them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.display import Displayed, record
from ...base.text import counted, quantity
from ...models import points
from ...models.part import LARGEST
from ...models.robot import Robot
from ..logs.clocks import LIKE, SURELY, realigned
from ..logs.encoders import locked, stretched
from ..logs.measurements import Measurements, measured_poses
from .differences import AS_GIVEN, FEWEST, PLAUSIBLE, LogPart, medians
from .explanations import VERY_CLEARLY, Way, explanations, is_noise, rms, with_order
from .frames import Frames, displaced_frames, fitted_frames, fitted_orders, in_convention
from .geometry import length_of
from .interpretations import Interpretation

MANY_CABLES = 6  # of fewer cables, frames explain what wrong anchors do
DISPLACED = 3.0  # times smaller differences, by a frame near the file's
SCALED = 2  # fits of frames with the scales of readings that were found with the frames before
EXPLAINED = 0.1  # of the change of the readings, which differences are below if lengths and poses belong together
FAR = 3.0  # times the noise, of differences that are not explained yet
MOST_STRETCHED = 1.05  # of a length: no cable is stretched more
LATEST = 0.1  # of a log's duration; speeds in a wrong frame may look similar at any other time
STILL = 2e-3  # of a length, by which the reading of a locked winch with noise may change
Placed = tuple[np.ndarray, np.ndarray, np.ndarray | None]  # positions, rotations, and poses of carriers


def part_of(robot: Robot, part: Measurements, table: np.ndarray) -> LogPart:
    """Return measurements as a part of a log."""
    position, rotation, known = measured_poses(robot, part)
    angles = points.angles(rotation) if part.poses is None else np.where(known[:, 3:], part.poses[:, 3:], 0.0)
    # An unknown tension stretches no cable here, and one in another unit, or of no cable, hardly any.
    stretch = np.clip(np.nan_to_num(stretched(robot, part.tensions), nan=1.0), 1.0, MOST_STRETCHED)
    y = part.lengths * table[:, 7] * stretch
    return LogPart(robot, table, position, rotation, angles, y, part.sigma.lengths, part.carrier_poses)


def aligned(robot: Robot, given: Measurements, rows: np.ndarray, table: np.ndarray) -> LogPart | None:
    """Return samples with the poses by the clock that cable speeds show, None if it is as good as theirs.

    A clock of the poses that is ahead is explained by no other frame or convention.
    """
    moved, clock = realigned(robot, given, rows)
    if clock is None or given.times is None:
        return None
    latest = LATEST * float(np.ptp(given.times))
    sure = clock.likeness > LIKE and SURELY * clock.sigma < abs(clock.offset) < latest
    return part_of(robot, moved, table).steady() if sure else None


@dataclass(frozen=True, eq=False)
class Unexplained(Displayed):
    """A log whose differences are no noise.

    Attributes:
        robot, given: The robot and all measurements.
        table: Parameters of the cables in the file, (m, 15).
        rows: Samples that are compared, (N,).
        log: These samples, by the clock that cable speeds show.
        noise: Largest differences by noise [m].
        ways: Explanations without other frames.
        as_given: Size of the differences of the log as it is [m].
    """

    robot: Robot
    given: Measurements
    table: np.ndarray
    rows: np.ndarray
    log: LogPart
    noise: float
    ways: list[Way]
    as_given: float

    @cached_property
    def whole(self) -> LogPart:
        """Return all samples."""
        return part_of(self.robot, self.given, self.table)

    @cached_property
    def still(self) -> bool:
        """Return whether winches are locked: units, signs and order of such readings do not show."""
        return locked(self.given.lengths, STILL)

    @cached_property
    def best(self) -> Way:
        """Return the best explanation."""
        return min((way for way in self.ways if way.text), key=lambda way: way[:2])

    @cached_property
    def most(self) -> float:
        """Return the size that differences must be below if lengths and poses belong together [m]."""
        log = self.log
        if not self.still:
            return EXPLAINED * float(np.median(np.abs(log.y - np.median(log.y, axis=0))))
        # Wrong anchors turn the cables, so they change lengths by a share of the motion.
        moved = float(np.median(np.linalg.norm(log.position - np.median(log.position, axis=0), axis=1)))
        return max(EXPLAINED * self.as_given, PLAUSIBLE * moved, self.noise)

    @property
    def named(self) -> bool:
        """Return whether an error without other frames is named."""
        return not self.still and self.best.weighted < self.as_given and self.best.size < self.most

    @property
    def left(self) -> float:
        """Return the size of the differences with the best explanation [m]."""
        return self.best.size * self.best.way.factor

    @property
    def far(self) -> bool:
        """Return whether differences are left that other frames may explain."""
        return self.left > FAR * self.noise if self.named else self.as_given > self.most


class Mistake(NamedTuple):
    """A probable input error of a log.

    Attributes:
        text: The error, in one line.
        corrected: Measurements without it, or None if several errors are equally probable.
        severe: True if a calibration would be wrong, False if it would only mean a frame other than the file's.
        factors: Factors of the readings in `corrected`, (m,) or one for all cables.
        columns: Column of the log for each cable, (m,); None if the columns are in the order of the cables.
    """

    text: str
    corrected: Measurements | None
    severe: bool = True
    factors: np.ndarray | float = 1.0
    columns: np.ndarray | None = None

    __repr__ = record

    @property
    def doubt(self) -> str | None:
        """Return the error and how to correct it, in one line, None if it only means another frame."""
        hint = "; --fix corrects it" if self.corrected else ""
        return f"the log probably has an input error: {self.text}{hint}" if self.severe else None


def better_by(text: str, before: float, after: float) -> str:
    """Return an error with how much smaller the differences are without it."""
    times = quantity(before / max(after, 1e-12), digits=2)
    return f"{text}: correcting this makes the differences between lengths and poses {times} times smaller"


def corrected_to(
    given: Measurements, placed: Placed, columns: np.ndarray, factors: np.ndarray | float, framed: tuple[str, ...] = ()
) -> Measurements:
    """Return measurements at other poses, with columns of readings in the order of the cables, times factors."""
    position, rotation, carriers = placed
    poses = given.poses
    if poses is not None:
        poses = np.where(np.isfinite(poses), np.hstack([position, points.angles(rotation)]), np.nan)
    tensions = None if given.tensions is None else given.tensions[:, columns]
    lengths = given.lengths[:, columns] * factors
    result = given.changed(lengths=lengths, poses=poses, tensions=tensions, carrier_poses=carriers)
    result.framed = framed or given.framed
    return result


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
        part = ordered.read_in(read)._replace(y=scaled, counted=False)
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
    moved, placed = (frames.of(*one.at(read)[:2]) for one in (log.whole, part))
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
