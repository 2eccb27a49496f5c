"""Make a path of straight pieces shorter and smoother, as far as it stays clear: `shortened`, `rounded`."""

from itertools import pairwise

import numpy as np
from numpy.random import Generator

from .clear_space import ClearSpace

SHORTCUTS = 150
ROUNDS = 2  # of cutting corners
CUT = 0.25  # of the two sides of a corner


def shortened(path: np.ndarray, clear: ClearSpace, rng: Generator) -> np.ndarray:
    """Return a path with straight pieces instead of detours, wherever random places of it can be joined.

    A group of coordinates is made straight at once, while the others stay as they are.
    """
    scale, groups = clear.space.scale, clear.space.groups
    for _ in range(SHORTCUTS):
        if len(path) < 3 or not clear.in_time:
            break
        at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0) * scale, axis=1))])
        ends = np.sort(rng.uniform(0.0, at[-1], 2))
        group = groups[rng.integers(len(groups))]
        i, j = np.searchsorted(at, ends, side="right")
        if i == j or ends[0] == ends[1]:
            continue
        p, q = (np.array([np.interp(place, at, column) for column in path.T]) for place in ends)
        piece = np.vstack([p, *([] if group.all() else path[i:j]), q])
        share = (np.r_[ends[0], at[i:j] if len(piece) > 2 else [], ends[1]] - ends[0]) / (ends[1] - ends[0])
        piece[:, group] = p[group] + share[:, None] * (q - p)[group]
        if clear.is_clear(piece):
            path = _without_idle(np.vstack([path[:i], piece, path[j:]]), scale)
    return path


def _without_idle(path: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return a path without the places between which it goes straight on."""
    kept = [path[0]]
    for place, after in pairwise(path[1:]):
        there, on = (place - kept[-1]) * scale, (after - kept[-1]) * scale
        along = there @ on / max(on @ on, 1e-300)
        if not (0.0 <= along <= 1.0 and np.linalg.norm(there - along * on) < 1e-9):
            kept.append(place)
    return np.vstack([*kept, path[-1]])


def rounded(path: np.ndarray, clear: ClearSpace) -> np.ndarray:
    """Return a path whose corners are cut where that is possible, again and again (Chaikin)."""
    for _ in range(ROUNDS):
        new = [path[0]]
        for before, corner, after in zip(path[:-2], path[1:-1], path[2:], strict=True):
            p, q = corner + CUT * (before - corner), corner + CUT * (after - corner)
            new += [p, q] if clear.is_clear(np.stack([p, q])) else [corner]
        path = np.vstack([*new, path[-1]])
    return path
