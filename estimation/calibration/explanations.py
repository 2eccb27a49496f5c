"""`explanations`: units, signs, orders of cables and conventions of angles that explain differences of a log.

Each interpretation of the log is tried with the order of cables that has the smallest differences between lengths at
the measured poses and readings (an assignment problem).

Conventions of angles differ little if the platform turns little. With e the differences of the given log and e' those
of another convention, of variance s^2, the sum of e^2 - e'^2 is |e - e'|^2 if the other is right, and has the standard
deviation 2 s |e - e'| (a likelihood ratio). Conventions that cannot be distinguished are named together.
"""

from typing import NamedTuple

import numpy as np

from ...base.text import quantity
from ...models import points
from .differences import LogPart, medians
from .geometry import length_of
from .interpretations import FACTORS, Interpretation, interpretations

CLEARLY, VERY_CLEARLY = 1.25, 2.0  # times smaller differences
SIGNIFICANT, TOLD_APART = 6.0, 5.0  # standard deviations by which one convention of angles is likelier than another
BY_CHANCE = 3.0  # standard deviations by which the squares of noise may exceed what was stated
LONG_TAIL = 4.0  # median sizes; differences beyond are wrong readings
HOPELESS = 2.0  # a convention is rejected if roughness, or rotation about locked axes, is so many times larger
TURNED = 1e-3  # [rad] about locked axes
OTHER_FACTOR, SAME_FACTOR = 0.1, 0.01  # difference of a factor from 1, and from the factor of a unit
FARTHEST = 3.0  # times the cables' mean length, of a motion


class Way(NamedTuple):
    """An explanation: its size with a penalty for complexity, its size, and what it corrects."""

    weighted: float
    size: float
    text: str
    way: Interpretation
    columns: np.ndarray
    signs: np.ndarray
    several: bool = False


def explanations(log: LogPart, e: np.ndarray, noise: float) -> tuple[list[Way], float]:
    """Return explanations of differences e (m, N), and the size of these as they are."""
    from scipy.optimize import linear_sum_assignment

    order, as_given, farthest = np.arange(log.robot.m), np.inf, FARTHEST * length_of(log.robot)
    unseen = bool(log.robot.dof_mask[3:].any()) and not log.angles.any()
    ways: list[Way] = []
    conventions: list[tuple[np.ndarray, Way]] = []
    tried = interpretations(bool(np.ptp(log.angles, axis=0).any()))
    base, rough, turned_aside = log.parts(tried[0]), log.roughness(tried), _aside(log, tried[0])
    for way, own in zip(tried, rough, strict=True):
        too_far = log.carriers is None and np.ptp(way.placed(log.position), axis=0).max() > farthest
        hopeless = own > HOPELESS * rough[0] or _aside(log, way) > max(HOPELESS * turned_aside, TURNED)
        if (way.turned and hopeless) or (way.text and too_far):
            continue
        lengths, y = log.parts(way) if way.placed is not tried[0].placed or way.turned else base
        both = np.stack([lengths[:, None] - sign * way.factor * y for sign in (1, -1)]) / way.factor
        apart = medians(both, len(log.y))  # (2, m, m): of both signs, of cable i and column j
        plain, best = np.diag(apart[0]), apart.min(axis=0)
        columns = linear_sum_assignment(best**2)[1] if np.isfinite(best).all() else order
        signs = np.where(apart[1, order, columns] < apart[0, order, columns], -1.0, 1.0)
        same, one = np.ones(len(order)), rms(plain)
        if not way.text:
            as_given = one
        elif way.turned and way.placed is tried[0].placed:
            other = (lengths - way.factor * y[order, order])[:, : len(log.y)]
            conventions.append((other, Way(one, one, way.text, way, order, same)))
        else:
            ways.append(Way(VERY_CLEARLY * one, one, way.text, way, order, same))
        if text := with_order(way.text, columns, signs):
            # Two errors at once are less likely than one. What counts are the cables that are read in another way.
            least = 1.0 if not way.text else CLEARLY if way.turned else VERY_CLEARLY
            moved = (columns != order) | (signs < 0)
            gain = rms(best[order, columns][moved]) / max(rms(plain[moved]), 1e-300) if moved.any() else 1.0
            size = rms(best[order, columns])
            weighted = VERY_CLEARLY * least * (min(size, gain * as_given) if not way.text else size)
            ways.append(Way(weighted, size, text, way, columns, signs))
        if way.factor == 1.0:
            ways += _multiples(lengths, y, len(log.y), way, unseen)
    likeliest = _likeliest(e, conventions)
    if likeliest is not None:
        # Errors that are no noise may seem smaller in another convention by chance.
        sure = root_mean_square(likeliest[0]) <= noise
        ways.append(likeliest[1]._replace(weighted=(1.0 if sure else CLEARLY) * likeliest[1].size))
    return ways, as_given


def _aside(log: LogPart, way: Interpretation) -> float:
    """Return by how much the platform turns about the axes about which the robot cannot turn it [rad]."""
    turned = log.rotation if way.turned is None else way.turned(log.rotation, log.angles)
    return float(np.ptp(points.angles(turned)[:, log.robot.dof_mask[3:] == 0], axis=0).max(initial=0.0))


def _multiples(lengths: np.ndarray, y: np.ndarray, count: int, way: Interpretation, unseen: bool) -> list[Way]:
    """Return the explanation that readings count something whose size is another one for each cable, or nothing.

    - `lengths`, `y`: as `LogPart.parts` returns them for `count` samples, read in a `way`.
    - `unseen`: True if turns of the platform were not measured, for which other sizes of each cable would make up.
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
    if unseen and not similar:
        return []
    listed = [unit] if similar else sizes.tolist()
    text = f"the lengths look like multiples of {', '.join(quantity(one, 'm', 3) for one in listed)}"
    text = with_order(f"{text}, such as a drum's angles", columns, factors)
    text = f"{text}, and {way.text}" if way.text else text
    simple = similar and (columns == order).all() and (factors > 0).all()
    size = rms(apart[order, columns]) / unit
    weight = VERY_CLEARLY ** (1 + (not simple) + bool(way.text))
    return [Way(weight * size, size, text, way._replace(text=text, factor=unit), columns, factors / unit)]


def _likelier(e: np.ndarray, other: np.ndarray) -> float:
    """Return by how many standard deviations the differences `other` are more likely than e, both (m, N)."""
    if not np.isfinite(other).all():
        return -np.inf
    limit = LONG_TAIL * float(np.median(np.abs(other)))
    one, two = np.clip(e, -limit, limit), np.clip(other, -limit, limit)
    spread = 2 * float(np.sqrt((two**2).mean()) * np.linalg.norm(one - two))
    return float((one**2).sum() - (two**2).sum()) / max(spread, 1e-300)


def _likeliest(e: np.ndarray, conventions: list[tuple[np.ndarray, Way]]) -> tuple[np.ndarray, Way] | None:
    """Return the convention of angles that is much more likely than the given one, with its equivalents."""
    best: tuple[np.ndarray, Way] | None = None
    for convention in conventions:
        if _likelier(e if best is None else best[0], convention[0]) > (SIGNIFICANT if best is None else 0.0):
            best = convention
    if best is None:
        return None
    other, way = best
    equals = [one.text for left, one in conventions if one.text != way.text and _likelier(left, other) < TOLD_APART]
    if len(equals) > 1:
        unknown = "the angles seem to have another convention, which cannot be determined"
        return other, way._replace(text=unknown, several=True)
    also = "".join(f", or {text.removeprefix('the angles look ')}" for text in equals)
    return other, way._replace(text=way.text + also, several=bool(equals))


def is_noise(log: LogPart, e: np.ndarray) -> bool:
    """Return whether differences e (m, N + c) of a log are as small as the stated standard deviation of lengths."""
    limit = log.sigma * np.sqrt(1 + BY_CHANCE * np.sqrt(2 / len(log.y)))
    return bool(max(map(root_mean_square, e[:, : len(log.y)])) <= limit)


def root_mean_square(e: np.ndarray) -> float:
    """Return the size of differences, with a bound on outliers."""
    limit = LONG_TAIL * float(np.median(np.abs(e)))
    return float(np.sqrt((np.clip(e, -limit, limit) ** 2).mean()))


def rms(sizes: np.ndarray) -> float:
    """Return the root mean square of sizes."""
    return float(np.sqrt((sizes**2).mean()))


def with_order(text: str, columns: np.ndarray, signs: np.ndarray) -> str:
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
