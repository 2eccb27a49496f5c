"""Simulated annealing of a layout on few poses: a start from which linear programs find a good local optimum.

From random layouts the linear programs alone stop where the available wrench set is flat: the margin is 0 there, more
than around. Coordinates drawn at their bounds, where good layouts have many, and swaps of attachments pass it. Cables
cannot be moved through each other by small steps, so the room between them is part of the score.

Boxes in which platforms move are mostly symmetric, and so are the best layouts for them: of two cables, one is the
mirror image of the other. A search among symmetric layouts has half of the variables, and finds better ones sooner.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from .evaluation import Evaluation
from .variables import Goal, Variables, by_cable

MOVES = 2000
_NEGATIVE = 0.05  # weight of the mean of negative margins
_HOT = 0.1  # first temperature, of the force scale
_AT_BOUND = 0.5  # probability that a redrawn coordinate is at one of its bounds
_SMALL = 0.1  # standard deviation of a small move, of the range of a coordinate
_MISSING_COSTS = 25.0  # cost, in force scales, of missing a bound of the room by the size of the robot
_ALIKE = 0.02  # of the extent of anchors, attachments or forces: how far bounds may be from mirror images of others


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


class Symmetry(NamedTuple):
    """Variables that follow from others: y[second] = offset + sign * y[first]."""

    first: np.ndarray  # (k,)
    second: np.ndarray  # (k,)
    offset: np.ndarray  # (k,)
    sign: np.ndarray  # 1 or -1, (k,)

    def applied(self, y: np.ndarray) -> np.ndarray:
        """Return the variables of the symmetric layout, (p,)."""
        y = y.copy()
        y[self.second] = self.offset + self.sign * y[self.first]
        return y


class Mirrors:
    """Random symmetries of a robot's layout.

    A plane of symmetry is through the middle of all anchors' bounds, and through that of all attachments' bounds. It is
    vertical, because weight has a direction.
    """

    def __init__(self, variables: Variables):
        m, S = variables.robot.m, variables.S
        ends = S * variables.low, S * variables.high
        low = variables.fixed + np.minimum(*ends).sum(axis=1)
        high = variables.fixed + np.maximum(*ends).sum(axis=1)
        self._low, self._high = by_cable(low, m), by_cable(high, m)  # (m, 8)
        used = (S != 0.0).sum(axis=0)
        columns = np.where((S != 0.0).any(axis=1), (S != 0.0).argmax(axis=1), -1)
        self._columns = by_cable(columns, m)  # the variable of each number, or -1
        self._shared = np.append(used > 1, False)[self._columns]  # with other numbers, (m, 8)
        middle = (self._low.min(axis=0) + self._high.max(axis=0)) / 2
        self._middle = np.r_[middle[:6], 0.0, 0.0]
        pulls = np.array(variables.robot.gravity) != 0.0
        extent = self._high.max(axis=0) - self._low.min(axis=0)
        scales = [extent[:3].max(), extent[3:6].max(), self._high[:, 6:].max()]
        self._tolerance = _ALIKE * np.repeat(scales, (3, 3, 2))  # (8,)
        #: Signs of x and y of the mirrorings; both at once are half a turn. Points that are all in the plane of a
        #: mirroring are their own images.
        self.signs = [
            (x, y)
            for x, y in ((1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
            if all(sign > 0.0 or (extent[k] > self._tolerance[k] and not pulls[k]) for k, sign in enumerate((x, y)))
        ]

    def symmetry(self, signs: tuple[float, float], rng: np.random.Generator) -> Symmetry | None:
        """Return cables in random pairs of which one may be the image of the other, or None if there are none."""
        sign = np.array([*signs, 1.0, *signs, 1.0, 1.0, 1.0])
        offset = (1.0 - sign) * self._middle
        low = offset + np.minimum(sign * self._low, sign * self._high)
        high = offset + np.maximum(sign * self._low, sign * self._high)
        left, pairs = list(rng.permutation(len(low))), []
        while left:
            one = left.pop()
            for other in left:
                apart = np.abs([low[one] - self._low[other], high[one] - self._high[other]])
                if (apart <= self._tolerance).all() and self._may_follow(one, other, sign):
                    left.remove(other)
                    pairs.append((one, other))
                    break
        chosen = [
            (self._columns[one, k], self._columns[other, k], offset[k], sign[k])
            for one, other in pairs
            for k in range(8)
            if self._columns[one, k] != self._columns[other, k]
        ]
        if not chosen:
            return None
        first, second, offsets, signs_of = (np.array(part) for part in zip(*chosen, strict=True))
        return Symmetry(first, second, offsets, signs_of)

    def _may_follow(self, one: int, other: int, sign: np.ndarray) -> bool:
        """Return whether each number of two cables is fixed, is free in each, or is shared and its own image."""
        first, second = self._columns[one], self._columns[other]
        alone = (first >= 0) & (second >= 0) & ~self._shared[one] & ~self._shared[other]
        return bool((alone | ((first == second) & ((first < 0) | (sign > 0)))).all())
