"""Simulated annealing of a layout on few poses: a start from which linear programs find a good local optimum.

From random layouts the linear programs alone stop where the available wrench set is flat: the margin is 0 there, more
than around. Coordinates drawn at their bounds, where good layouts have many, and swaps of attachments pass it. Cables
cannot be moved through each other by small steps, so the room between them is part of the score.
"""

from __future__ import annotations

import time

import numpy as np

from .evaluation import Evaluation
from .goal import Goal
from .symmetry import Symmetry
from .variables import Variables

MOVES = 2000
_NEGATIVE = 0.05  # weight of the mean of negative margins
_HOT = 0.1  # first temperature, of the force scale
_AT_BOUND = 0.5  # probability that a redrawn coordinate is at one of its bounds
_SMALL = 0.1  # standard deviation of a small move, of the range of a coordinate
_MISSING_COSTS = 25.0  # cost, in force scales, of missing a bound of the room by the size of the robot


def anneal(evaluation: Evaluation, goal: Goal, moves: Moves, rng: np.random.Generator, until: float) -> np.ndarray:
    """Return the variables of a good layout for the rows of an evaluation, (p,).

    - `evaluation`: an evaluation of few poses, because it is repeated thousands of times.
    - `goal`: the objective.
    - `moves`: the random changes.
    - `until`: time of `time.perf_counter` at which it ends [s]: where an evaluation takes long, with fewer moves.
    """
    force = evaluation.variables.robot.force_scale

    def score(y: np.ndarray, least: float) -> float:
        found = evaluation.margins(y)
        value = goal.value(y, evaluation.outcome_besides(y, goal, float(found.min())))
        value += _NEGATIVE * float(np.minimum(found, 0.0).mean())
        if value > least:  # else it is refused without the distances
            value -= _MISSING_COSTS * force / evaluation.room.size * evaluation.missing(y)
        return value

    y = moves.layout(rng)
    value = score(y, -np.inf)
    best, best_value = y, value
    started, count = time.perf_counter(), MOVES
    for number in range(MOVES):
        temperature = force * _HOT * max(0.0, 1.0 - number / count) ** 2 + 1e-9
        least = value + temperature * float(np.log(rng.random() + 1e-300))  # by Metropolis
        candidate = moves.neighbour(y, rng)
        candidate_value = score(candidate, least)
        if candidate_value > least:
            y, value = candidate, candidate_value
            if value > best_value:
                best, best_value = y, value
        if number % 100 == 99:
            now = time.perf_counter()
            count = min(MOVES, round(number * (until - started) / (now - started)))
            if now > until:
                break
    return best


class Moves:
    """Random layouts and random neighbours of a layout: symmetric ones, where a symmetry is given."""

    def __init__(self, variables: Variables, symmetry: Symmetry | None = None):
        self._low, self._high, self._symmetry = variables.low, variables.high, symmetry
        following = set() if symmetry is None else set(symmetry.second.tolist())
        self._points = [point for point in variables.points if not following.intersection(point.tolist())]
        self._placed = [point for point in self._points if not variables.limits[point].any()] or self._points
        groups: dict[tuple[float, ...], list[np.ndarray]] = {}
        for point in self._points:
            groups.setdefault((*self._low[point], *self._high[point]), []).append(point)
        self._alike = [group for group in groups.values() if len(group) > 1]  # of the same bounds: interchangeable

    def layout(self, rng: np.random.Generator) -> np.ndarray:
        """Return the variables of a random layout, (p,)."""
        return self._symmetric(rng.uniform(self._low, self._high))

    def neighbour(self, y: np.ndarray, rng: np.random.Generator, limits: bool = True) -> np.ndarray:
        """Return a layout after a move, (p,): two points swapped, one, two or a coordinate redrawn, or a small step.

        Without `limits`, tension limits are only swapped, unless nothing else is free: linear programs find them best.
        """
        low, high, points = self._low, self._high, self._points if limits else self._placed
        y, kind = y.copy(), rng.integers(5)
        point = points[rng.integers(len(points))]
        if kind == 0 and self._alike:
            group = self._alike[rng.integers(len(self._alike))]
            one, other = (group[k] for k in rng.choice(len(group), 2, replace=False))
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
        return self._symmetric(y)

    def _symmetric(self, y: np.ndarray) -> np.ndarray:
        if self._symmetry is None:
            return y
        # Bounds are not exactly mirror images of others.
        return np.minimum(np.maximum(self._symmetry.applied(y), self._low), self._high)


def drawn(low: np.ndarray, high: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return random numbers inside bounds, about half of them at one."""
    share = rng.random(low.size)
    at_bound = rng.random(low.size) < _AT_BOUND
    return low + np.where(at_bound, share < 0.5, share) * (high - low)
