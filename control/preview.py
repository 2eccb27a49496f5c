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
        t = after.reshape(-1, *[1] * (part.ndim - 2))
        place, rate, acceleration = np.moveaxis(part[before], -2, 0)
        ramp = (part[following][..., 2, :] - acceleration) / period
        moved = place + t * (rate + t / 2 * (acceleration + t / 3 * ramp))
        faster = rate + t * (acceleration + t / 2 * ramp)
        result.append(np.stack([moved, faster, acceleration + t * ramp], axis=-2))
    share = after[:, None] / period
    last = rows[3][before]
    return *result, last + share * (rows[3][following] - last)
