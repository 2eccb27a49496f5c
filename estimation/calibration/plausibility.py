"""`mistake`: detect input errors of a log before the fit, which would hide them in wrong parameters, and mend them.

With the right order of cables, units and convention of angles, the difference between a cable's length at the measured
poses and its reading hardly changes: it is the offset plus the effect of a displaced anchor. So other interpretations
of the log are tried, with the order of cables that has the smallest differences (an assignment problem). An error is
named if the differences become much smaller without it. If they are already as small as the stated standard deviation,
nothing is tried.

Conventions of angles differ little if the platform turns little. With e the differences of the given log and e' those
of another convention, of variance s^2, the sum of e^2 - e'^2 is |e - e'|^2 if the other is right, and has the standard
deviation 2 s |e - e'| (a likelihood ratio). Conventions that cannot be distinguished are named together.

If nothing explains the differences, poses may have been measured in another frame, or of another body (`frames`). Such
a frame near the file's is named, but not refused, if it explains most of the differences up to an offset.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ...base.display import record
from ...base.text import counted, quantity
from ...models import points
from ...models.files import as_robot
from ...models.robot import Robot
from ..logs.clocks import LIKE, SURELY, realigned
from ..logs.encoders import locked
from ..logs.measurements import Measurements, check_measurements, measured, measured_poses, tracked
from .attitudes import misread_attitudes
from .differences import AS_GIVEN, FEWEST, PLAUSIBLE, LogPart, medians
from .frames import displaced_frames, fitted_frames, fitted_orders, in_convention
from .geometry import length_of
from .interpretations import FACTORS, Interpretation, interpretations
from .parameters import Parameters

CLEARLY, DECISIVELY, VERY_CLEARLY = 1.25, 1.5, 2.0  # times smaller differences
SIGNIFICANT, TOLD_APART = 6.0, 5.0  # standard deviations by which one convention of angles is likelier than another
BY_CHANCE = 3.0  # standard deviations by which the squares of noise may exceed what was stated
LONG_TAIL = 4.0  # median sizes; differences beyond are wrong readings
EXPLAINED = 0.1  # of the change of the readings, which differences are below if lengths and poses belong together
MOST_SAMPLES = 400
HOPELESS = 2.0  # a convention is rejected if the roughness is so many times larger
LARGEST = 10.0  # times the cables' mean length, of a change of readings
MANY_CABLES = 6  # of fewer cables, frames explain what wrong anchors do
DISPLACED = 3.0  # times smaller differences, by a frame near the file's
LAST_STEP = 3  # of fits of frames: to readings as they are, up to scales, and twice with these scales
FAR = 3.0  # times the noise, of differences that are not explained yet
STILL = 2e-3  # of a length, by which the reading of a locked winch with noise may change
OTHER_FACTOR, SAME_FACTOR = 0.1, 0.01  # from 1, and from those of units
Placed = tuple[np.ndarray, np.ndarray, np.ndarray | None]  # positions, rotations, and poses of carriers


class Mistake(NamedTuple):
    """A probable input error of a log.

    Attributes:
        text: The error, in one line.
        corrected: Measurements without it, or None if several errors are equally probable.
        severe: True if a calibration would be wrong, False if it would only mean a frame other than the file's.
        factors: Factors of the readings in `corrected`, (m,) or one for all cables.
    """

    text: str
    corrected: Measurements | None
    severe: bool = True
    factors: np.ndarray | float = 1.0

    __repr__ = record

    @property
    def doubt(self) -> str | None:
        """Return the error and how to correct it, in one line, None if it only means another frame."""
        hint = "; `towline calibrate --fix` corrects it" if self.corrected else ""
        return f"the log probably has an input error: {self.text}{hint}" if self.severe else None


class _Way(NamedTuple):
    """An explanation: its size with a penalty for complexity, its size, and what it corrects."""

    weighted: float
    size: float
    text: str
    way: Interpretation
    columns: np.ndarray
    signs: np.ndarray
    several: bool = False


def mistake(robot: Robot, measurements: Measurements) -> Mistake | None:
    """Detect the probable input error of a log by the robot's file, before any fit; None if there is none.

    Raises `InputError` if the measurements have another number of cables.
    """
    robot = as_robot(robot)
    given = check_measurements(robot, measurements)
    parameters = Parameters(robot, ())
    table = parameters.table(parameters.first)
    carriers, known = given.carrier_poses, measured(given)
    framed = carriers is None and bool((known.any(axis=0) | (robot.dof_mask == 0))[3:].all())
    rows = np.flatnonzero(tracked(robot, given))
    if len(rows) < 4:
        large = _too_large(robot, given, given.lengths * table[:, 7])
        attitudes = None if large else misread_attitudes(robot, given)
        return Mistake(*attitudes) if attitudes else large
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), MOST_SAMPLES)).astype(int)]
    log, e = _part(robot, given.only(rows), table).sound()
    if not _is_noise(log, e) and (aligned := _aligned(robot, given, rows, table)) is not None:
        log, e = aligned.sound()
    order, e = np.arange(robot.m), e[:, : len(log.y)]
    noise = log.sigma * np.sqrt(1 + BY_CHANCE * np.sqrt(2 / e.size))
    if _is_noise(log, e):
        return _displaced(log, given, noise) if framed else None
    turns = bool(np.ptp(log.angles, axis=0).any()) and robot.dof_mask.sum() == 6  # with one angle, others would fit
    ways, as_given = _explanations(log, e, noise)
    best = min((way for way in ways if way.text), key=lambda way: way[:2])
    still = locked(given.lengths, STILL)  # units, signs and order of such readings do not show
    change = float(np.median(np.abs(log.y - np.median(log.y, axis=0))))
    if still:  # wrong anchors turn the cables, so they change lengths by a share of the motion
        moved = float(np.median(np.linalg.norm(log.position - np.median(log.position, axis=0), axis=1)))
        change = max(as_given, PLAUSIBLE * moved / EXPLAINED, noise / EXPLAINED)
    named = not still and best.weighted < as_given and best.size < EXPLAINED * change
    far = best.size * best.way.factor > FAR * noise if named else as_given > EXPLAINED * change
    whole = _part(robot, given, table) if named or far else log
    given_order = log
    orders = () if not far or not framed or len(log.y) < FEWEST[1] else [(order, 0)] if still else _orders(log)
    for first, rivals in orders:
        log = given_order._replace(y=given_order.y[:, first])
        part, read, frames = log, AS_GIVEN, None
        for step in range(1 if still else LAST_STEP + 1):
            part = part._replace(counted=step == 1)
            # With scales that are known, the frames are near those before, and found more exactly.
            frames = fitted_frames(part, frames if step > 1 else None, FAR * noise)
            read = AS_GIVEN if step < 2 else read
            if step < 2 and turns and frames.size > FAR * noise:
                frames, read = in_convention(part, frames)
            moved = frames.of(whole.position, whole.at(read)[1])
            placed = frames.of(log.position, log.at(read)[1])
            there, left = log._replace(position=placed[0], rotation=placed[1]).sound()
            if not step and not _is_noise(there, left):  # speeds show the clock in the right frame only
                ordered = _corrected(given, (*moved, None), first, 1.0)
                there, left = (_aligned(robot, ordered, rows, table) or there).sound()
            size = _rms(medians(left, len(there.y)))
            way = _Way(VERY_CLEARLY * size, size, "", AS_GIVEN, order, np.ones(robot.m))
            if step:
                others = (one for one in _explanations(there, left[:, : len(there.y)], noise)[0] if one.way.of_readings)
                way = min(others, default=way, key=lambda one: one.weighted)
            if step and frames.size > FAR * EXPLAINED * change * way.way.factor:  # with any scales
                break
            left_before, factors = min(as_given, best.size * best.way.factor), way.signs * way.way.factor
            if step and step < LAST_STEP:
                part = log._replace(y=log.y[:, way.columns] * factors, rotation=log.at(read)[1])
            elif way.weighted * way.way.factor < left_before and way.size < EXPLAINED * change:
                text = _better(str(frames), as_given, way.size)
                texts = _and("", first, np.ones(robot.m)), way.text, read.text, text
                text = ", and ".join(filter(None, texts))
                if rivals:
                    return Mistake(f"{text}; but {counted(rivals, 'other order')} in other frames fit as well", None)
                if not still and (first == order).all() and len(frames.found) > 1:
                    better = fitted_orders(given_order)
                    if not any((one == first[way.columns]).all() for one in better):
                        other = _and("", better[0], np.ones(robot.m))
                        return Mistake(f"{text}; or {other}, in other frames that are simpler or fit better", None)
                corrected = _corrected(given, (*moved, None), first[way.columns], factors, frames.found)
                return Mistake(text, corrected, factors=factors)
    if named:
        factors = best.signs * best.way.factor
        # Fitted scales reduce the differences of any log; the remainder may be due to a wrong explanation.
        rival = min((way for way in ways if way.text not in ("", best.text)), default=best, key=lambda way: way[:2])
        fitted = best.way.factor not in (1.0, *FACTORS)
        open_ = far and fitted and best is not rival and rival.weighted < DECISIVELY * best.weighted
        text = _better(best.text, as_given, best.size)
        if open_:
            text = f"{text}; but something else explains them nearly as well: {rival.text}"
        several = best.several or open_
        corrected = None if several else _corrected(given, whole.at(best.way), best.columns, factors)
        return Mistake(text, corrected, factors=factors)
    return None if far or not framed else _displaced(log, given, noise)


def _orders(log: LogPart) -> Iterator[tuple[np.ndarray, int]]:
    """Yield the order of the readings as given, and that in which frames fit best, with how many fit as well."""
    given = np.arange(log.robot.m)
    yield given, 0
    first, *others = fitted_orders(log)
    if (first != given).any():
        yield first, len(others)


def _better(text: str, before: float, after: float) -> str:
    times = quantity(before / max(after, 1e-12), digits=2)
    return f"{text}: correcting this makes the differences between lengths and poses {times} times smaller"


def _corrected(
    given: Measurements, placed: Placed, columns: np.ndarray, factors: np.ndarray | float, framed: tuple[str, ...] = ()
) -> Measurements:
    position, rotation, carriers = placed
    poses = given.poses
    if poses is not None:
        poses = np.where(np.isfinite(poses), np.hstack([position, points.angles(rotation)]), np.nan)
    tensions = None if given.tensions is None else given.tensions[:, columns]
    lengths = given.lengths[:, columns] * factors
    result = given.changed(lengths=lengths, poses=poses, tensions=tensions, carrier_poses=carriers)
    result.framed = framed or given.framed
    return result


def _displaced(log: LogPart, given: Measurements, noise: float) -> Mistake | None:
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
        sizes = [_rms(medians(one.sound(0)[1], len(one.y))) for one in logs]
        if sizes[0] < VERY_CLEARLY * sizes[1]:
            return None  # displaced ends of cables are as plausible
    position, rotation, _ = measured_poses(robot, given)
    corrected = _corrected(given, (*frames.of(position, rotation), None), np.arange(robot.m), 1.0, frames.found)
    shift, turn = frames.inner
    moved = np.linalg.norm(robot.attachments @ (turn - np.eye(3)).T + shift, axis=1).max()
    severe = bool(moved > PLAUSIBLE * length_of(robot))
    return Mistake(_better(str(frames), before, frames.size), corrected, severe)


def _aligned(robot: Robot, given: Measurements, rows: np.ndarray, table: np.ndarray) -> LogPart | None:
    """Return samples with the poses by the clock that cable speeds show, None if it is as good as theirs.

    A clock of the poses that is ahead is explained by no other frame or convention.
    """
    moved, clock = realigned(robot, given, rows)
    sure = clock is not None and clock.likeness > LIKE and abs(clock.offset) > SURELY * clock.sigma
    return _part(robot, moved, table) if sure else None


def _part(robot: Robot, part: Measurements, table: np.ndarray) -> LogPart:
    """Return measurements as a part of a log."""
    position, rotation, known = measured_poses(robot, part)
    angles = points.angles(rotation) if part.poses is None else np.where(known[:, 3:], part.poses[:, 3:], 0.0)
    y = part.lengths * table[:, 7]
    return LogPart(robot, table, position, rotation, angles, y, part.sigma.lengths, part.carrier_poses)


def _is_noise(log: LogPart, e: np.ndarray) -> bool:
    """Return whether differences e (m, N + c) of a log are as small as the stated standard deviation of lengths."""
    limit = log.sigma * np.sqrt(1 + BY_CHANCE * np.sqrt(2 / len(log.y)))
    return bool(max(map(_root_mean_square, e[:, : len(log.y)])) <= limit)


def _explanations(log: LogPart, e: np.ndarray, noise: float) -> tuple[list[_Way], float]:
    """Return explanations of differences e (m, N), and the size of these as they are."""
    from scipy.optimize import linear_sum_assignment

    order, as_given = np.arange(log.robot.m), np.inf
    ways: list[_Way] = []
    turns: list[tuple[np.ndarray, _Way]] = []
    tried = interpretations(bool(np.ptp(log.angles, axis=0).any()))
    base, rough = log.parts(tried[0]), log.roughness(tried)
    for way, own in zip(tried, rough, strict=True):
        if way.turned and own > HOPELESS * rough[0]:
            continue
        lengths, y = log.parts(way) if way.placed is not tried[0].placed or way.turned else base
        both = np.stack([lengths[:, None] - sign * way.factor * y for sign in (1, -1)]) / way.factor
        apart = medians(both, len(log.y))  # (2, m, m): of both signs, of cable i and column j
        plain, best = np.diag(apart[0]), apart.min(axis=0)
        columns = linear_sum_assignment(best**2)[1] if np.isfinite(best).all() else order
        signs = np.where(apart[1, order, columns] < apart[0, order, columns], -1.0, 1.0)
        same, one = np.ones(len(order)), _rms(plain)
        if not way.text:
            as_given = one
        elif way.turned and way.placed is tried[0].placed:
            other = (lengths - way.factor * y[order, order])[:, : len(log.y)]
            turns.append((other, _Way(one, one, way.text, way, order, same)))
        else:
            ways.append(_Way(VERY_CLEARLY * one, one, way.text, way, order, same))
        if text := _and(way.text, columns, signs):
            # Two errors at once are less likely than one. What counts are the cables that are read in another way.
            least = 1.0 if not way.text else CLEARLY if way.turned else VERY_CLEARLY
            moved = (columns != order) | (signs < 0)
            gain = _rms(best[order, columns][moved]) / max(_rms(plain[moved]), 1e-300) if moved.any() else 1.0
            size = _rms(best[order, columns])
            weighted = VERY_CLEARLY * least * (min(size, gain * as_given) if not way.text else size)
            ways.append(_Way(weighted, size, text, way, columns, signs))
        if way.factor == 1.0:
            ways += _multiples(lengths, y, len(log.y), way)
    likeliest = _likeliest(e, turns)
    if likeliest is not None:
        # Errors that are no noise may seem smaller in another convention by chance.
        sure = _root_mean_square(likeliest[0]) <= noise
        ways.append(likeliest[1]._replace(weighted=(1.0 if sure else CLEARLY) * likeliest[1].size))
    return ways, as_given


def _multiples(lengths: np.ndarray, y: np.ndarray, count: int, way: Interpretation = AS_GIVEN) -> list[_Way]:
    """Return the explanation that readings count something whose size is another one for each cable, or nothing.

    - `lengths`, `y`: as `LogPart.parts` returns them for `count` samples, read in a `way`.
    """
    from scipy.optimize import linear_sum_assignment

    order = np.arange(len(lengths))
    fitted = np.einsum("mk,mnk->mn", lengths, y) / np.maximum((y**2).sum(axis=2), 1e-300)  # of cable i and column j
    sizes = np.abs(fitted)
    for usual, near in ((1.0, OTHER_FACTOR), *((factor, SAME_FACTOR) for factor in FACTORS)):
        sizes = np.where(np.abs(sizes / usual - 1) < near, usual, sizes)
    apart = medians(lengths[:, None] - (np.sign(fitted) * sizes)[..., None] * y, count)
    if not np.isfinite(apart).all():
        return []
    columns = linear_sum_assignment(apart**2)[1]
    sizes, factors = sizes[order, columns], (np.sign(fitted) * sizes)[order, columns]
    if not sizes.all() or (sizes[0] in (1.0, *FACTORS) and (sizes == sizes[0]).all()):
        return []
    unit = float(np.median(sizes))
    similar = bool((np.abs(sizes / unit - 1) < OTHER_FACTOR).all())
    listed = [unit] if similar else sizes.tolist()
    text = f"the lengths look like multiples of {', '.join(quantity(one, 'm', 3) for one in listed)}"
    text = _and(f"{text}, such as a drum's angles", columns, factors)
    text = f"{text}, and {way.text}" if way.text else text
    simple = similar and (columns == order).all() and (factors > 0).all()
    size = _rms(apart[order, columns]) / unit
    weight = VERY_CLEARLY ** (1 + (not simple) + bool(way.text))
    return [_Way(weight * size, size, text, way._replace(text=text, factor=unit), columns, factors / unit)]


def _root_mean_square(e: np.ndarray) -> float:
    """Return the size of differences, with a bound on outliers."""
    limit = LONG_TAIL * float(np.median(np.abs(e)))
    return float(np.sqrt((np.clip(e, -limit, limit) ** 2).mean()))


def _likelier(e: np.ndarray, other: np.ndarray) -> float:
    """Return by how many standard deviations the differences `other` are more likely than e, both (m, N)."""
    if not np.isfinite(other).all():
        return -np.inf
    limit = LONG_TAIL * float(np.median(np.abs(other)))
    one, two = np.clip(e, -limit, limit), np.clip(other, -limit, limit)
    spread = 2 * float(np.sqrt((two**2).mean()) * np.linalg.norm(one - two))
    return float((one**2).sum() - (two**2).sum()) / max(spread, 1e-300)


def _likeliest(e: np.ndarray, turns: list[tuple[np.ndarray, _Way]]) -> tuple[np.ndarray, _Way] | None:
    """Return the convention of angles that is much more likely than the given one, with its equivalents."""
    best: tuple[np.ndarray, _Way] | None = None
    for turn in turns:
        if _likelier(e if best is None else best[0], turn[0]) > (SIGNIFICANT if best is None else 0.0):
            best = turn
    if best is None:
        return None
    other, way = best
    equals = [one.text for left, one in turns if one.text != way.text and _likelier(left, other) < TOLD_APART]
    if len(equals) > 1:
        unknown = "the angles seem to have another convention, which cannot be determined"
        return other, way._replace(text=unknown, several=True)
    also = "".join(f", or {text.removeprefix('the angles look ')}" for text in equals)
    return other, way._replace(text=way.text + also, several=bool(equals))


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


def _rms(sizes: np.ndarray) -> float:
    return float(np.sqrt((sizes**2).mean()))


def _and(text: str, columns: np.ndarray, signs: np.ndarray) -> str:
    """Return an input error, with the columns of the log that belong to the cables and their signs."""
    texts = [text] if text else []
    moved = np.flatnonzero(columns != np.arange(len(columns)))
    if moved.size == 2:
        texts.append(f"l{moved[0]} and l{moved[1]} look exchanged")
    elif moved.size:
        order = ", ".join(f"l{column}" for column in columns)
        texts.append(f"the cables look like columns {order} of the log, in this order")
    wrong = np.flatnonzero(signs < 0)
    if wrong.size == len(signs):
        texts.append("the lengths seem to have the wrong sign, as if their scales were negative")
    elif wrong.size:
        names = ", ".join(f"l{columns[i]}" for i in wrong)
        texts.append(f"{names} {'seems' if wrong.size == 1 else 'seem'} to have the wrong sign")
    return ", and ".join(texts)
