"""Simulated annealing of a layout on few poses: a start from which linear programs find a good local optimum.

From random layouts the linear programs alone stop where the available wrench set is flat: the margin is 0 there, more
than around. Coordinates drawn at their bounds, where good layouts have many, and swaps of attachments pass it. Cables
cannot be moved through each other by small steps, so the room between them is part of the score.
"""

import time

import numpy as np

from .evaluation import Evaluation
from .goal import Goal

MOVES = 8000
_NEGATIVE = 0.05  # weight of the mean of negative margins
_AT_BOUND = 0.5  # probability that a redrawn coordinate is at one of its bounds
_SMALL = 0.1  # standard deviation of a small move, of the range of a coordinate
_HOT, _WARM = 0.1, 0.01  # first temperature, of the force scale, from a random layout and near a good one
_MISSING_COSTS = 5.0  # force scales per metre by which a bound of the room is missed


def anneal(
    evaluation: Evaluation, goal: Goal, rng: np.random.Generator, until: float, near: np.ndarray | None = None
) -> np.ndarray:
    """Return the variables of a good layout for the rows of an evaluation, (p,).

    - `evaluation`: an evaluation of few poses, because it is repeated thousands of times.
    - `goal`: the objective.
    - `until`: time of `time.perf_counter` at which it ends [s]: where an evaluation takes long, with fewer moves.
    - `near`: initial layout, annealed at a lower temperature; default: random ones.
    """
    variables = evaluation.variables
    low, high, points = variables.low, variables.high, variables.points
    force = variables.robot.force_scale
    alike = _interchangeable(points, low, high)

    def score(y: np.ndarray, least: float) -> float:
        found = evaluation.margins(y)
        value = goal.value(y, evaluation.outcome_besides(y, goal, float(found.min())))
        value += _NEGATIVE * float(np.minimum(found, 0.0).mean())
        if value > least:  # else it is refused without the distances
            value -= _MISSING_COSTS * force * evaluation.missing(y)
        return value

    y = rng.uniform(low, high) if near is None else near
    hot = force * (_HOT if near is None else _WARM)
    value = score(y, -np.inf)
    best, best_value = y, value
    started, moves = time.perf_counter(), MOVES
    for number in range(MOVES):
        temperature = hot * max(0.0, 1.0 - number / moves) ** 2 + 1e-9
        least = value + temperature * float(np.log(rng.random() + 1e-300))  # by Metropolis
        candidate = _moved(y, low, high, points, alike, rng)
        candidate_value = score(candidate, least)
        if candidate_value > least:
            y, value = candidate, candidate_value
            if value > best_value:
                best, best_value = y, value
        if number % 100 == 99:
            now = time.perf_counter()
            moves = min(MOVES, round(number * (until - started) / (now - started)))
            if now > until:
                break
    return best


def _moved(
    y: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    points: tuple[np.ndarray, ...],
    alike: list[np.ndarray],
    rng: np.random.Generator,
) -> np.ndarray:
    """Return a neighbour: two points swapped, one or two redrawn, one coordinate redrawn, or a small step."""
    y, kind = y.copy(), rng.integers(5)
    point = points[rng.integers(len(points))]
    if kind == 0 and alike:
        group = alike[rng.integers(len(alike))]
        one, other = (points[group[k]] for k in rng.choice(len(group), 2, replace=False))
        y[one], y[other] = y[other], y[one]
    elif kind == 1 or kind == 2:
        for each in (point,) if kind == 1 else (point, points[rng.integers(len(points))]):
            y[each] = drawn(low[each], high[each], rng)
    elif kind == 3:
        one = point[rng.integers(point.size), None]
        y[one] = drawn(low[one], high[one], rng)
    else:
        step = _SMALL * rng.standard_normal(point.size) * (high[point] - low[point])
        y[point] = np.minimum(np.maximum(y[point] + step, low[point]), high[point])
    return y


def drawn(low: np.ndarray, high: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return random numbers inside bounds, about half of them at one."""
    share = rng.random(low.size)
    at_bound = rng.random(low.size) < _AT_BOUND
    return low + np.where(at_bound, share < 0.5, share) * (high - low)


def _interchangeable(points: tuple[np.ndarray, ...], low: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
    """Return groups of points, of two or more, that have the same bounds."""
    groups: dict[tuple[float, ...], list[int]] = {}
    for number, point in enumerate(points):
        groups.setdefault((*low[point], *high[point]), []).append(number)
    return [np.array(group) for group in groups.values() if len(group) > 1]
