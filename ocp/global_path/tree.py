"""`connect`: a path between two configurations, past all that is in its way, by two trees that grow to each other.

Source: Kuffner and LaValle, RRT-Connect: an efficient approach to single-query path planning, ICRA 2000.
"""

from collections.abc import Callable, Iterator

import numpy as np

Advance = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Return the farthest configuration that is reached from the first on the straight line to the second."""

LONGEST = 0.4  # of the distance of both ends: steps of the trees


class _Tree:
    """Configurations, each with the one that it was reached from."""

    def __init__(self, root: np.ndarray):
        self.nodes = root[None].copy()
        self.parents = [-1]

    def nearest(self, target: np.ndarray, scale: np.ndarray) -> int:
        return int((((self.nodes - target) * scale) ** 2).sum(axis=1).argmin())

    def add(self, node: np.ndarray, parent: int) -> int:
        self.nodes = np.vstack([self.nodes, node])
        self.parents.append(parent)
        return len(self.parents) - 1

    def grow(self, index: int, target: np.ndarray, groups: list[np.ndarray], advance: Advance) -> int:
        """Return the node that is reached from node `index` towards `target`: straight, or else round a corner."""
        at = self.nodes[index]
        reached = advance(at, target)
        if np.array_equal(reached, target):
            return self.add(reached, index)
        for group in groups:
            corner = np.where(group, target, at)
            if np.array_equal(corner, at) or np.array_equal(corner, target):
                continue
            if not np.array_equal(advance(at, corner), corner):
                continue
            if np.array_equal(farther := advance(corner, target), target):
                return self.add(farther, self.add(corner, index))
        return index if np.array_equal(reached, at) else self.add(reached, index)

    def to_root(self, index: int) -> list[np.ndarray]:
        path = []
        while index >= 0:
            path.append(self.nodes[index])
            index = self.parents[index]
        return path


def connect(
    start: np.ndarray,
    end: np.ndarray,
    scale: np.ndarray,
    groups: list[np.ndarray],
    targets: Iterator[np.ndarray],
    advance: Advance,
    go_on: Callable[[], bool],
) -> np.ndarray | None:
    """Return configurations (k, count) from `start` to `end`, each reached from the one before; None if none is found.

    Parameters
    ----------
    scale
        (count,) what the unit of each coordinate counts in distances.
    groups
        Masks (count,) of coordinates that a tree also tries to change before all others.
    targets
        Configurations to grow to.
    go_on
        Returns whether there is time for another step.
    """
    if np.array_equal(advance(start, end), end):
        return np.stack([start, end])
    near, far, swapped = _Tree(start), _Tree(end), False
    longest = LONGEST * float(np.linalg.norm((end - start) * scale))
    while go_on():
        target = next(targets)
        parent = near.nearest(target, scale)
        apart = float(np.linalg.norm((target - near.nodes[parent]) * scale))
        target = near.nodes[parent] + (target - near.nodes[parent]) * min(1.0, longest / max(apart, 1e-12))
        new = near.grow(parent, target, groups, advance)
        if new != parent:
            reached = near.nodes[new]
            other = far.grow(far.nearest(reached, scale), reached, groups, advance)
            if np.array_equal(far.nodes[other], reached):
                path = near.to_root(new)[::-1] + far.to_root(other)
                return np.stack(path[::-1] if swapped else path)
        near, far, swapped = far, near, not swapped
    return None
