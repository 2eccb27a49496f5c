"""Symmetric layouts: of two cables, one is the mirror image of the other.

Boxes in which platforms move are mostly symmetric, and so are the best layouts for them. A search among symmetric
layouts has half of the variables, and finds better ones in less time.
"""

from typing import NamedTuple

import numpy as np

from .variables import Variables, by_cable

_ALIKE = 0.02  # of the extent of anchors, attachments or forces: how far bounds may be from mirror images of others


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
