"""The largest boxes of required positions: layouts and sizes are improved in turn.

The layout with the largest margin in the boxes keeps the required margin in larger ones, too. In the largest of these
another layout has a larger margin, and so on. A size that is found is therefore one that a layout meets, not a bound.
"""

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .evaluation import Evaluation, rows_of, with_tasks
from .requirements import Requirements
from .room import room_of
from .search import Found, Progress, search
from .variables import Variables

_ROUNDS = 6  # of layouts and sizes, at most
_SAME = 0.005  # relative change of a size that ends the search
_SAMPLES = 2_000  # random poses of each requirement, besides its grid, at which a size is judged
_LARGEST = 1e3  # times the required size
_SMALLER = 0.5  # of a step of which the audit has found that it was too large
_AT_ONCE = 1e-3  # [s] of a search after an interrupt: the robot's own layout is only audited
_SPARE = 1.005  # of the margin: what is kept, since another audit may find a little less


class Grown(NamedTuple):
    """Requirements with boxes that are larger, and a layout that meets them."""

    found: Found
    requirements: Requirements
    size: float  # of the boxes: a factor of the edges of those in the file
    size_before: float  # of the largest boxes in which the robot's own layout meets the requirements


def grown(requirements: Requirements, size: float) -> Requirements:
    """Return requirements whose boxes are larger by a factor about their centres."""
    require = []
    for each in requirements.require:
        if each.box is not None:
            low, high = np.array(each.box.min), np.array(each.box.max)
            centre, half = (low + high) / 2, size * (high - low) / 2
            box = each.box.model_copy(
                update={"min": tuple((centre - half).tolist()), "max": tuple((centre + half).tolist())}
            )
            each = each.model_copy(update={"box": box})
        require.append(each)
    return requirements.model_copy(update={"require": tuple(require)})


def grow(variables: Variables, requirements: Requirements, progress: Progress) -> Grown:
    """Search until the time limit for the layout that meets the requirements in the largest boxes."""
    started = time.perf_counter()
    until = started + requirements.time_limit
    inner = requirements.model_copy(update={"time_limit": requirements.time_limit / _ROUNDS})
    size, before = 1.0, _largest(_holds(variables, inner, variables.of_robot()), 0.0)

    def of_all(what: str, share: float, margin: float) -> None:
        share = (time.perf_counter() - started) / requirements.time_limit
        progress(f"boxes {size:.2f} times as large, {what}", min(share, 1.0), margin)

    # The robot's own layout is a first result, unless its margin in these boxes was overestimated.
    best = None
    if before > 1.0 and inner.start == "robot":
        size = before
        best = Grown(search(variables, grown(inner, size), of_all), grown(inner, size), size, before)
    if best is None or not _meets(best):
        size, stopped = 1.0, best is not None and best.found.stopped
        shorter = inner.model_copy(update={"time_limit": _AT_ONCE}) if stopped else inner
        best = Grown(search(variables, shorter, of_all), inner, size, before)
        best.found.stopped |= stopped
        if not _meets(best):
            return best
    inner = inner.model_copy(update={"start": "robot"})
    share = 1.0
    while not best.found.stopped and time.perf_counter() < until:
        try:
            holds = _largest(_holds(variables, inner, best.found.y), best.size)
        except KeyboardInterrupt:
            best.found.stopped = True
            break
        size = best.size + share * (max(holds, best.size * (1.0 + 2 * _SAME)) - best.size)
        if size < best.size * (1.0 + _SAME):
            break
        larger = grown(inner, size)
        candidate = Grown(search(variables, larger, of_all, best.found.y), larger, size, before)
        if _meets(candidate, _SPARE):
            best = candidate
        else:
            share *= _SMALLER
            best.found.stopped = candidate.found.stopped
    return best


def _meets(result: Grown, spare: float = 1.0) -> bool:
    """Return whether a layout meets its requirements, with some more margin than is required."""
    outcome = result.found.outcome
    return outcome.margin >= spare * result.requirements.margin and outcome.missing <= 0.0


def _holds(variables: Variables, requirements: Requirements, y: np.ndarray) -> Callable[[float], bool]:
    """Return a function of a size: whether a layout meets the requirements at the poses of grids and at random ones."""
    robot, room = variables.robot, room_of(variables.robot, requirements)

    def holds(size: float) -> bool:
        larger, random = grown(requirements, size).require, np.random.default_rng(0)
        places = [np.concatenate([each.places(), each.sampled(_SAMPLES, random)]) for each in larger]
        evaluation = Evaluation(variables, with_tasks(rows_of(robot, larger, places), robot, requirements.tasks), room)
        return bool(evaluation.margins(y).min() >= _SPARE * requirements.margin and evaluation.missing(y) <= 0.0)

    return holds


def _largest(holds: Callable[[float], bool], least: float) -> float:
    """Return the largest size up to which a layout holds, at least `least`; by doubling, then by halves."""
    low, high = least, max(2.0 * least, 1.0)
    while high < _LARGEST and holds(high):
        low, high = high, 2.0 * high
    while high - low > 0.2 * _SAME * high and high > _SAME:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
