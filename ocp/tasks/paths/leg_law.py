"""`leg_law`: the law of one leg from rest to rest, with little acceleration for its duration, and its inverse.

The acceleration is constant but for a tenth of the leg at both ends and a fifth at its middle, where it changes by the
smooth step 3 x^2 - 2 x^3. Its peak is 4.98 ways per squared duration: 4 is the least that any law has, and
`rest_to_rest` has 7.51. As in `rest_to_rest` acceleration and jerk are zero at both ends.
"""

import numpy as np

RAMP = 0.1  # of the leg, in which the acceleration rises from zero to its peak; it changes sign in twice that
PEAK = 4 / (1 - 2 * RAMP + 0.4 * RAMP**2)  # so that the way is 1
HALVINGS = 60


def leg_law(s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the share of the way and its first two derivatives, at the shares s of the time; before and after: rest.

    With s from 0 to 1, phi(1 - s) = 1 - phi(s).
    """
    s = np.clip(s, 0.0, 1.0)
    early = s <= 0.5
    since = np.where(early, s, 1 - s)
    # Shares done of the smooth steps at the beginning and in the middle, and the time since the first ended.
    up, after = np.minimum(since / RAMP, 1.0), np.maximum(since - RAMP, 0.0)
    down = np.maximum((since - 0.5) / (2 * RAMP) + 0.5, 0.0)
    up_2, down_2 = up * up, down * down
    rate = PEAK * (RAMP * up_2 * up * (1 - 0.5 * up) + after - 4 * RAMP * down_2 * down * (1 - 0.5 * down))
    rate_rate = PEAK * (up_2 * (3 - 2 * up) - 2 * down_2 * (3 - 2 * down))
    rise = RAMP**2 * up_2 * up_2 * (0.25 - 0.1 * up) + after * (RAMP + after) / 2
    way = PEAK * (rise - 8 * RAMP**2 * down_2 * down_2 * (0.25 - 0.1 * down))
    return np.where(early, way, 1 - way), rate, np.where(early, rate_rate, -rate_rate)


def inverse(done: np.ndarray) -> np.ndarray:
    """Return the shares of the time at which these shares of the way are done, from 0 to 1/2."""
    low, high = np.zeros_like(done), np.full_like(done, 0.5)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        less = leg_law(middle)[0] < done
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    return low
