"""Let two successive legs overlap as far as the corner allows: `largest_left`, and in time: `shares_of_time`.

`even_out` then gives each leg as much time as makes all of them accelerate alike, overlaps included. Accelerations of
positions [m/s^2] and of rotations [rad/s^2] are compared each on its own: `size` is the larger of the two.

The usual law's acceleration is constant but for a tenth of the leg at both ends and a fifth at its middle, where it
changes by the smooth step 3 x^2 - 2 x^3. Its peak is 4.98 ways per squared duration: 4 is the least that any law has,
and `rest_to_rest` has 7.51. As in `rest_to_rest` acceleration and jerk are zero at both ends. The legs of teams have
the law `smoother_rest_to_rest`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ....base.display import Displayed
from .line import SMOOTHER_PEAK, smoother_rest_to_rest

RAMP = 0.1  # of the leg, in which the acceleration rises from zero to its peak; it changes sign in twice that
PEAK = 4 / (1 - 2 * RAMP + 0.4 * RAMP**2)  # so that the way is 1
HALVINGS = 60
MOST = 0.5  # of the shorter of two legs
PARTS = 12  # of that, which are compared
LOOKS = 16  # at the acceleration of two legs together
TOGETHER = 1.1  # of the larger peak of one leg alone: the acceleration of two together
BACK = 1e-3  # of the sum of the unit vectors of two legs: the path turns back, and rests there
STEPS, AT_BOUNDS = 30, 12  # of `meeting`, which mostly needs 6; how many may end at a bound
ROUNDED = 1e-12  # of an overlap
ROUNDS = 8  # of `even_out`: more change the times by less than a hundredth


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


def size(vectors: np.ndarray) -> np.ndarray:
    """Return the larger norm of position and rotation, (...), of vectors (..., 6)."""
    return np.maximum(np.linalg.norm(vectors[..., :3], axis=-1), np.linalg.norm(vectors[..., 3:], axis=-1))


@dataclass(frozen=True)
class Overlap(Displayed):
    """The overlap of legs that have one time law, from rest to rest; `peak` is its largest second derivative."""

    law: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
    peak: float

    def inverse(self, done: np.ndarray) -> np.ndarray:
        """Return the shares of the time at which these shares of the way are done, from 0 to 1/2."""
        low, high = np.zeros_like(done), np.full_like(done, 0.5)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            less = self.law(middle)[0] < done
            low, high = np.where(less, middle, low), np.where(less, high, middle)
        return low

    def largest_left(self, steps: np.ndarray, last: np.ndarray, most: np.ndarray, blend: float) -> np.ndarray:
        """Return what the leg before each inner point has left where the next one has done as much, (n - 2,) [m].

        It is as large as the blend, the longest permitted overlap and the accelerations of both legs together permit,
        and zero where the path turns back.

        - `steps`: the legs, (n - 1, 6).
        - `last`: how long each moves, (n - 1,).
        - `most`: the longest permitted overlap at each inner point, (n - 2,).
        - `blend`: the largest distance from the point, of the position [m] and of the attitude [rad].
        """
        lengths = np.linalg.norm(steps, axis=1)
        along = steps / np.where(lengths > 0, lengths, 1.0)[:, None]
        turn = size(np.diff(along, axis=0))
        back = np.linalg.norm(along[1:] + along[:-1], axis=1) <= BACK
        straight = self._left_at(self._gentle(steps, last, most), last, lengths)
        left = (
            np.minimum(straight, blend / np.maximum(turn, np.finfo(float).tiny)) if blend > 0 else np.zeros_like(turn)
        )
        return np.where(back | (lengths[1:] == 0) | (lengths[:-1] == 0), 0.0, left)

    def shares_of_time(self, left: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how early each leg starts before its first point and how late it ends after its last, (n - 1,) each.

        Both are shares of the leg's time. `left` is the length that is left at each inner point, (n - 2,) [m].
        """
        early, late = np.zeros(len(lengths)), np.zeros(len(lengths))
        some = np.flatnonzero(left > 0)
        early[some + 1] = self.inverse(left[some] / lengths[some + 1])
        late[some] = self.inverse(left[some] / lengths[some])
        return early, late

    def even_out(self, steps: np.ndarray, last: np.ndarray, early: np.ndarray, late: np.ndarray) -> np.ndarray:
        """Return how long each leg moves, (n - 1,), if all are to reach the same peak acceleration, but for their sum.

        A leg that accelerates more than others, alone or together with the one before or after it, lasts longer. This
        lowers the peak of the whole path at the same duration.

        - `steps`: the legs, (n - 1, 6).
        - `last`: how long each moves at first, (n - 1,).
        - `early`, `late`: from `shares_of_time`: they are kept, and with them the path.
        """
        for _ in range(ROUNDS):
            peak = self.peak * size(steps) / last**2
            together = self._together(steps, last, late[:-1] * last[:-1] + early[1:] * last[1:])
            peak[:-1] = np.maximum(peak[:-1], together)
            peak[1:] = np.maximum(peak[1:], together)
            last = last * (peak / peak.mean()) ** 0.25
        return last

    def _gentle(self, steps: np.ndarray, last: np.ndarray, most: np.ndarray) -> np.ndarray:
        """Return the longest overlap, up to `most`, in which two legs together accelerate little more than one."""
        alone = self.peak * size(steps) / last**2
        bound = TOGETHER * np.maximum(alone[1:], alone[:-1])
        best = np.zeros_like(most)
        for part in np.arange(1, PARTS + 1) / PARTS:
            best = np.where(self._together(steps, last, part * most) <= bound, part * most, best)
        return best

    def _together(self, steps: np.ndarray, last: np.ndarray, overlap: np.ndarray) -> np.ndarray:
        """Return the peak acceleration while two legs overlap for so long, (n - 2,)."""
        since = overlap[:, None] * np.arange(LOOKS + 1) / LOOKS
        last_before, last_after = last[:-1, None], last[1:, None]
        slower = self.law((overlap[:, None] - since) / last_before)[2] / last_before**2
        faster = self.law(since / last_after)[2] / last_after**2
        return size(faster[..., None] * steps[1:, None] - slower[..., None] * steps[:-1, None]).max(axis=1)

    def _left_at(self, overlap: np.ndarray, last: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """Return what one leg has left and the next has done where these are equal, if they overlap for so long."""
        since = self.meeting(overlap, (lengths[:-1], last[:-1]), (lengths[1:], last[1:]))
        done, left = self.law(since / last[1:])[0], self.law((overlap - since) / last[:-1])[0]
        return np.minimum(lengths[1:] * done, lengths[:-1] * left)

    def meeting(
        self,
        overlap: np.ndarray,
        before: tuple[np.ndarray, np.ndarray],
        after: tuple[np.ndarray, np.ndarray],
        ahead: np.ndarray | float = 0.0,
    ) -> np.ndarray:
        """Return when in an overlap (n,) the next leg has done what the one before has left, and `ahead` more, (n,).

        `before` and `after` are the length of each leg and how long it moves.
        """
        (length_before, last_before), (length_after, last_after) = before, after
        low, high = np.zeros_like(overlap), overlap
        at = (low + high) / 2
        for k in range(STEPS):  # by Newton's method, else by halves
            left, left_rate, _ = self.law((overlap - at) / last_before)
            done, rate, _ = self.law(at / last_after)
            value = length_after * done - length_before * left - ahead
            slope = length_after * rate / last_after + length_before * left_rate / last_before
            low, high = np.where(value < 0, at, low), np.where(value < 0, high, at)
            step = value / np.maximum(slope, np.finfo(float).tiny)
            good = (at - step >= low) & (at - step <= high) | (np.abs(step) <= ROUNDED * overlap)
            # From a bound itself steps lead inside; halves would not come near a result that is next to it.
            at = np.where(good, at - step, np.clip(at - step, low, high) if k < AT_BOUNDS else (low + high) / 2)
            if (np.abs(step) <= ROUNDED * overlap).all():
                break
        return at


USUAL = Overlap(leg_law, PEAK)
SMOOTHER = Overlap(smoother_rest_to_rest, SMOOTHER_PEAK)
