"""`frozen`: poses that a motion capture repeats while it does not see the platform."""

import numpy as np

LONGEST_HELD = 5  # equal rows in a row that a slower sensor may repeat
JUMP = 5.0  # times the usual step: where the platform is seen again, it is far from where it seemed to stand


def frozen(values: np.ndarray) -> np.ndarray:
    """Return which rows of recorded poses (N, k) repeat one before, though the platform moved on, (N,) of bool.

    A platform at rest does not jump at the end.
    """
    result = np.zeros(len(values), dtype=bool)
    steps = np.linalg.norm(np.diff(np.nan_to_num(values), axis=0), axis=1)
    moves = np.flatnonzero(steps > 0)
    if not moves.size:
        return result
    usual = float(np.median(steps[moves]))
    edges = np.concatenate([[-1], moves, [len(steps)]])  # rows edges[i] + 1 to edges[i + 1] are equal
    for begin, end in zip(edges[:-1] + 1, edges[1:] + 1, strict=True):
        if end - begin > LONGEST_HELD and end < len(values) and steps[end - 1] > JUMP * usual:
            result[begin + bool(values[begin].any()) : end] = True  # zeros are no pose at all
    return np.asarray(result & np.isfinite(values).all(axis=1))
