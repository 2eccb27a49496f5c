"""Random changes of a layout."""

import numpy as np

from .symmetry import Symmetry
from .variables import Variables

_AT_BOUND = 0.5  # probability that a redrawn coordinate is at one of its bounds
_SMALL = 0.1  # standard deviation of a small move, of the range of a coordinate


class Moves:
    """Random layouts and random neighbours of a layout: symmetric ones, where a symmetry is given."""

    def __init__(self, variables: Variables, symmetry: Symmetry | None = None):
        self._low, self._high, self._symmetry = variables.low, variables.high, symmetry
        following = set() if symmetry is None else set(symmetry.second.tolist())
        self._points = [point for point in variables.points if not following.intersection(point.tolist())]
        groups: dict[tuple[float, ...], list[np.ndarray]] = {}
        for point in self._points:
            groups.setdefault((*self._low[point], *self._high[point]), []).append(point)
        self._alike = [group for group in groups.values() if len(group) > 1]  # of the same bounds: interchangeable

    def layout(self, rng: np.random.Generator) -> np.ndarray:
        """Return the variables of a random layout, (p,)."""
        return self._symmetric(rng.uniform(self._low, self._high))

    def neighbour(self, y: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return a layout with two points swapped, one or two or a coordinate redrawn, or a small step, (p,)."""
        low, high, points = self._low, self._high, self._points
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
