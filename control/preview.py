"""What a predictive controller looks ahead to: `rows_at`, references between those that were announced."""

from __future__ import annotations

import numpy as np

__all__ = ["ROUNDING", "rows_at"]

ROUNDING = 1e-9  # of a period


def rows_at(
    rows: tuple[np.ndarray, ...], after: np.ndarray, before: np.ndarray, period: float
) -> tuple[np.ndarray, ...]:
    """Return references at times between those that are known.

    Between two of them accelerations and tensions change evenly; beyond the last one accelerations stay.

    Parameters
    ----------
    rows
        Platforms (K, 3, 6), carriers (K, c, 3, 6) and moved coordinates (K, 3, f), each place, rate and acceleration,
        and tensions (K, m) [N].
    after
        How long after a row each time is, (N,) [s].
    before
        The number of that row, (N,).
    period
        From one row to the next [s].
    """
    if np.abs(after).max() <= ROUNDING * period:
        return tuple(part[before] for part in rows)
    following = np.minimum(before + 1, len(rows[0]) - 1)
    result = []
    for part in rows[:3]:
        t, motion = after.reshape(-1, *[1] * (part.ndim - 2)), part[before]
        rate, acceleration = motion[..., 1, :], motion[..., 2, :]
        change = t / period * (part[following][..., 2, :] - acceleration)
        motion[..., 0, :] += t * (rate + t / 2 * (acceleration + change / 3))
        rate += t * (acceleration + change / 2)
        acceleration += change
        result.append(motion)
    last = rows[3][before]
    return *result, last + after[:, None] / period * (rows[3][following] - last)
