"""How far a quantity may leave the line between two instants at which it is known: `leaves`.

A quantity that is smooth there leaves it by no more than an eighth of its second derivative times the square of the
time between. That is estimated from the instants around, twice as large as there, since it changes in between. Where a
quantity may jump between two instants, nothing is smooth: they are the sides of the jump, or not neighbours at all.
"""

import numpy as np

SAME = 1e-7  # of the whole time: nearer instants are the two sides of a jump
SAFETY = 2.0


def is_jump(times: np.ndarray) -> np.ndarray:
    """Return between which of the `times` (n,) of a whole motion a quantity may jump, (n - 1,)."""
    return np.diff(times) < SAME * (times[-1] - times[0])


def leaves(times: np.ndarray, values: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    """Return how far values (n, ...) leave the line between each two of `times` at most, (n - 1, ...)."""
    wide = (-1, *[1] * (values.ndim - 1))
    h = np.diff(times)
    slopes = np.diff(values, axis=0) / h.reshape(wide)
    bent = np.zeros_like(values)
    bent[1:-1] = np.abs(np.diff(slopes, axis=0)) / ((h[1:] + h[:-1]) / 2).reshape(wide)
    bent[1:-1][jumps[1:] | jumps[:-1]] = 0.0
    return between(times, bent)


def between(times: np.ndarray, bent: np.ndarray) -> np.ndarray:
    """Return how far what has second derivatives (n, ...) of that size leaves the line between two instants."""
    padded = np.concatenate([bent[:1], bent, bent[-1:]])
    most = np.maximum(np.maximum(padded[:-3], padded[1:-2]), np.maximum(padded[2:-1], padded[3:]))
    return SAFETY / 8 * most * (np.diff(times) ** 2).reshape(-1, *[1] * (bent.ndim - 1))
