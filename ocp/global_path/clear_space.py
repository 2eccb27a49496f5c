"""`ClearSpace`: which configurations are clear, and how far straight pieces between them are."""

import time
from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np
from numpy.random import Generator

from .at_rest import AtRest, unsure
from .space import Space

OF_END = 0.9  # of the slack at an end: what is kept there, if that is less than the reserve
RISE = 0.3  # of the distance from such an end: how fast the reserve returns
STEP = 0.25  # of the robot's size: the longest step between places that are checked for tensions
FEW, BATCH = 4, 16  # places at a time, first and then
TRIED, CHOSEN = 64, 6  # random configurations, and how many of those that are clear the trees grow to
PLACES = 61  # along the direct motion
ANYWHERE = 0.3  # share of the formations that are to fit elsewhere than in its way
FORMATIONS = 32  # in each generation of a formation that fits
SPREADS = (0.4, 0.28, 0.2, 0.14, 0.1, 0.07, 0.05, 0.03)  # of their changes, a generation each
MOVED = 0.2  # of the robot's size: how far the platform moves for a change of one
AHEAD = 0.1  # of the robot's size: a step past an obstacle
NARROW = 0.03  # of the robot's size: gaps much narrower do not count for more


class ClearSpace:
    """The configurations whose slack is the reserve or more; near an end that has less, as much as can be kept there.

    - `reserve`: by how much all limits are kept [m].
    - `evaluated`, `most`: how many configurations have been evaluated, and how many are in a search.
    - `deadline`: when a search ends, by `time.perf_counter` [s].
    """

    def __init__(self, space: Space, rest: AtRest, reserve: float, most: float = np.inf, deadline: float = np.inf):
        self.space, self.rest, self.reserve, self.most, self.deadline = space, rest, reserve, most, deadline
        self.evaluated = 0
        kept = rest(*space.poses(space.ends))
        self._at_ends = np.minimum(reserve, OF_END * np.maximum(kept.slack, 0.0))
        self._longest = STEP * space.size

    @property
    def in_time(self) -> bool:
        """Return whether there is time left."""
        return time.perf_counter() < self.deadline

    def _evaluate(self, configurations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return by how much configurations (n, count) keep more than the reserve [m], and their points."""
        self.evaluated += len(configurations)
        kept = self.rest(*self.space.poses(configurations))
        needed = np.minimum(self.reserve, (self._at_ends + RISE * self._from_ends(configurations)).min(axis=1))
        return kept.slack - needed, kept.points

    def _from_ends(self, configurations: np.ndarray) -> np.ndarray:
        """Return how far configurations (n, count) are from start and end, (n, 2) [m]."""
        return np.linalg.norm((configurations[:, None] - self.space.ends) * self.space.scale, axis=2)

    def targets(self, rng: Generator, longest: float = np.inf) -> Iterator[np.ndarray]:
        """Yield random configurations that are clear, those that are barely so first of all: they lie in gaps.

        Paths from start to end through them may be as short as `longest` [m].
        """
        while True:
            tried = np.array([self.space.sample(rng) for _ in range(TRIED)])
            tried = tried[self._from_ends(tried).sum(axis=1) < longest]
            if not len(tried):
                yield self.space.ends.mean(axis=0)
                continue
            yield tried[rng.integers(len(tried))]
            if self.space.shaped:
                elsewhere = not len(self._in_the_way) or rng.random() < ANYWHERE
                fitting = self._fitting(tried[0] if elsewhere else rng.choice(self._in_the_way), rng)
                if fitting is not None:
                    yield fitting
            slack, _ = self._evaluate(tried)
            clear = np.flatnonzero(slack >= 0.0)
            if clear.size:
                weight = 1.0 / (slack[clear] + NARROW * self.space.size)
                count = min(CHOSEN, clear.size)
                yield from tried[rng.choice(clear, count, replace=False, p=weight / weight.sum())]

    @cached_property
    def _in_the_way(self) -> np.ndarray:
        """Return the configurations of the direct motion that are not clear, (k, count)."""
        start, end = self.space.ends
        direct = start + np.linspace(0.0, 1.0, PLACES)[:, None] * (end - start)
        return direct[self._evaluate(direct)[0] < 0.0]

    def _fitting(self, about: np.ndarray, rng: Generator) -> np.ndarray | None:
        """Return the configuration near `about` whose formation has the most space; None if even it is not clear.

        In a gap hardly any random formation is clear, but good ones grow out of bad ones by selection.
        """
        space = self.space
        shape = space.groups[-1]
        tried = np.repeat(about[None], FORMATIONS, axis=0)
        tried[:, shape] = [space.sample_shape(rng) for _ in range(FORMATIONS)]
        step = np.where(shape, 1.0, MOVED * space.size / space.scale)
        found, slack = grown(space, tried, lambda each: self._evaluate(each)[0], step, rng)
        return found if slack >= 0.0 else None

    def fitting(self, rng: Generator) -> np.ndarray | None:
        """Return a configuration in the way of the direct motion, or near it, whose formation is clear; or None."""
        about = rng.choice(self._in_the_way) if len(self._in_the_way) else self.space.sample(rng)
        return self._fitting(about, rng)

    def beside(self, at: np.ndarray, target: np.ndarray, rng: Generator) -> np.ndarray | None:
        """Return a clear configuration near `at` from which a step to `target` has the most space; None if none has."""
        space = self.space
        way = (target - at) * space.scale
        length = float(np.linalg.norm(way))
        if length == 0.0:
            return None
        ahead = (target - at) * min(1.0, AHEAD * space.size / length)
        step = np.where(space.groups[-1], 1.0, MOVED * space.size / space.scale)
        spreads = rng.choice(SPREADS, FORMATIONS)[:, None]
        tried = at + rng.normal(0.0, 1.0, (FORMATIONS, len(at))) * spreads * step
        tried[0] = at
        slack = np.where(space.is_mirrored(tried), -np.inf, self._evaluate(tried)[0])
        clear = np.flatnonzero(slack >= 0.0)
        if not clear.size:
            return None
        space_ahead = self._evaluate(tried[clear] + ahead)[0]
        best = int(space_ahead.argmax())
        return tried[clear[best]] if space_ahead[best] >= 0.0 else None

    def are_clear(self, configurations: np.ndarray) -> bool:
        """Return whether all configurations (n, count) are clear."""
        return bool((self._evaluate(configurations)[0] >= 0.0).all())

    def advance(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the farthest configuration on the straight line from `start`, which is clear, to `end`."""
        length = float(np.linalg.norm((end - start) * self.space.scale))
        if length == 0.0:
            return end
        shares = np.linspace(0.0, 1.0, int(np.ceil(length / self._longest)) + 1)
        last = 0.0
        first, batch = 0, FEW  # most pieces that are not clear end soon
        while first < len(shares) - 1:
            chunk = shares[first : first + batch + 1]
            last = self._clear_until(start, end, chunk)
            if last < chunk[-1]:
                break
            first, batch = first + batch, BATCH
        return end if last == 1.0 else start + last * (end - start) if last > 0.0 else start

    def is_clear(self, corners: np.ndarray) -> bool:
        """Return whether the straight pieces between configurations (k, count) are clear, of which the ends are.

        All pieces are halved at once: where one is not clear, few configurations show it.
        """
        slack, points = self._evaluate(corners)
        slack[[0, -1]] = np.maximum(slack[[0, -1]], 0.0)
        while slack.min() >= 0.0:
            long = np.linalg.norm(np.diff(corners, axis=0) * self.space.scale, axis=1) > self._longest
            halved = np.union1d(np.flatnonzero(long), unsure(slack, points, 1 + RISE))
            if not halved.size:
                return True
            middle = (corners[halved] + corners[halved + 1]) / 2
            more, more_points = self._evaluate(middle)
            corners = np.insert(corners, halved + 1, middle, axis=0)
            slack = np.insert(slack, halved + 1, more)
            points = np.insert(points, halved + 1, more_points, axis=0)
        return False

    def _clear_until(self, start: np.ndarray, end: np.ndarray, shares: np.ndarray) -> float:
        """Return the largest of `shares` of a straight line, or one between, up to which it is clear from the first."""
        slack, points = self._evaluate(start + shares[:, None] * (end - start))
        slack[0] = max(slack[0], 0.0)
        while True:
            bad = np.flatnonzero(slack < 0.0)
            if bad.size:
                shares, slack, points = shares[: bad[0]], slack[: bad[0]], points[: bad[0]]
            open_ones = unsure(slack, points, 1 + RISE)
            if not open_ones.size:
                return float(shares[-1])
            middle = (shares[open_ones] + shares[open_ones + 1]) / 2
            more, more_points = self._evaluate(start + middle[:, None] * (end - start))
            shares = np.insert(shares, open_ones + 1, middle)
            slack = np.insert(slack, open_ones + 1, more)
            points = np.insert(points, open_ones + 1, more_points, axis=0)


def grown(
    space: Space, tried: np.ndarray, score: Callable[[np.ndarray], np.ndarray], step: np.ndarray, rng: Generator
) -> tuple[np.ndarray, float]:
    """Return the best configuration that grows out of `tried` (n, count) by selection, and its score.

    `step` is how far each coordinate changes, (count,).
    """
    scores = score(tried)
    for spread in SPREADS:
        best = np.argsort(-scores)[: FORMATIONS // 4]
        more = np.repeat(tried[best], 4, axis=0)
        more += rng.normal(0.0, spread, more.shape) * step
        new = np.where(space.is_mirrored(more), -np.inf, score(more))
        tried, scores = np.vstack([tried[best], more]), np.concatenate([scores[best], new])
    found = int(scores.argmax())
    return tried[found], float(scores[found])
