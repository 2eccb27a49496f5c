"""The shortest shifts along the axes of {G} to where a robot can be: `shortest_shifts`."""

from collections.abc import Callable, Iterator

import numpy as np

from ..tasks.scenario import POSITION, Scenario

STEP = 1.3  # ratio of successive shifts
SHIFTS = STEP ** np.arange(-36, 3)  # in parts of the robot's size
HALVINGS = 5


def shortest_shifts(scenario: Scenario, size: float, holds: Callable[[np.ndarray], bool]) -> Iterator[np.ndarray]:
    """Yield the shortest shift (3,) [m] along each axis and direction that `holds`, the shortest of all first.

    `size` is the robot's size [m].
    """
    ways = [sign * np.eye(3)[axis] for axis in POSITION if scenario.robot.dof_mask[axis] for sign in (1, -1)]
    for far in SHIFTS * size:
        found = []
        for k in [k for k, way in enumerate(ways) if holds(far * way)][::-1]:
            way, low, high = ways.pop(k), far / STEP, far
            for _ in range(HALVINGS):
                middle = (low + high) / 2
                low, high = (low, middle) if holds(middle * way) else (middle, high)
            found.append((high, way))
        yield from (high * way for high, way in sorted(found, key=lambda pair: pair[0]))
