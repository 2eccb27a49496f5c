"""`in_one_formation`: a path on which a team changes its formation at both ends only.

In a narrow gap hardly any formation is clear, and trees that change position and formation together rarely find the way
to it. A formation that passes the gap is found there; with it, only positions are searched.
"""

from collections.abc import Iterator

import numpy as np
from numpy.random import Generator

from .clear_space import ClearSpace
from .tree import connect

ON_THE_WAY, IN_PLACE = 3_000, 2_000  # configurations for one formation's way, and for its change at an end


def in_one_formation(clear: ClearSpace, rng: Generator, most: float) -> np.ndarray | None:
    """Return clear configurations (k, count) from start to end, or None if at `most` so many do not show them."""
    start, end = clear.space.ends
    formation, most = clear.space.groups[-1], min(clear.evaluated + most, clear.most)
    while clear.evaluated < most and clear.in_time:
        fitting = clear.fitting(rng)
        if fitting is None:
            continue
        first, last = (np.where(formation, fitting, each) for each in (start, end))
        if not clear.are_clear(np.stack([first, last])):
            continue
        way = connect(clear, first, last, _positions(clear, rng, fitting), ON_THE_WAY)
        before = None if way is None else connect(clear, start, first, _formations(clear, rng, start), IN_PLACE)
        after = None if before is None else connect(clear, last, end, _formations(clear, rng, end), IN_PLACE)
        if way is not None and before is not None and after is not None:
            return np.vstack([before, way[1:], after[1:]])
    return None


def _positions(clear: ClearSpace, rng: Generator, fitting: np.ndarray) -> Iterator[np.ndarray]:
    """Yield random positions and attitudes with one formation."""
    while True:
        yield np.where(clear.space.groups[-1], fitting, clear.space.sample(rng))


def _formations(clear: ClearSpace, rng: Generator, at: np.ndarray) -> Iterator[np.ndarray]:
    """Yield random formations in place."""
    while True:
        target = at.copy()
        target[clear.space.groups[-1]] = clear.space.sample_shape(rng)
        yield target
