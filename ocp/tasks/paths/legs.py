"""Overlapped straight legs: a path through points that stays inside their box and near to the lines between them.

Leg k moves the pose from point k to point k + 1 by the time law phi from rest to rest (`leg_law`). Consecutive legs
overlap in time, so the path rounds its points instead of stopping at them:

    x(t) = p_0 + sum_k phi((t - t_k) / tau_k) d_k.

The legs' times tau_k are such that all reach the same peak acceleration, as they would with tau_k ~ sqrt(|d_k|) if they
did not overlap (`overlap.even_out`).

At most two legs move at a time, and together less than one leg is still to do or already done, so each position is a
mean of three successive points: it lies in the box of the points. Where one leg has r left and the next has done r, the
path passes their common point at the distance r |u_b - u_a|, with u the unit vectors along the legs, and nowhere is it
farther from the legs. Attitudes are R_k exp(phi_k w_k) exp(phi_k+1 w_k+1), with w the shortest rotations.

Lengths combine positions and rotations, with 1 rad equal to 1 m.
"""

from collections.abc import Sequence
from functools import cached_property, lru_cache

import numpy as np

from .attitudes import Attitudes, Progress, nearest_turn
from .base import Motion
from .overlap import MOST, SMOOTHER, USUAL, Overlap, size

BLEND = 0.01  # of the span of the points; accelerations hardly fall with more
LOOKS = 48  # at the angles of each leg
MOST_KNOWN = 20_000  # times of a motion that is remembered, of 150 bytes each


class Legs:
    """Straight legs through points.

    A motion along them is where it is in a `leg`, (n,), and how much of this leg and of the next one is done, with two
    derivatives: those before are done, and only these two move.

    - `points`: (n, 6) poses.
    - `blend`: the largest distance at which the path passes its points [m]; default: a share of their span.
    - `times`: (n,), the times at which it passes them [s]; default: any duration, all legs with the same peak
      acceleration.
    - `dwell`: (n,), dwell time at each [s]; default: none.
    - `shares`: whether `times` are shares of the duration, from 0 to 1: the way is then the same one as without.
    - `smoother`: whether the legs have five derivatives that are zero at both ends.
    """

    def __init__(
        self,
        points: Sequence[Sequence[float]],
        blend: float | None,
        times: Sequence[float] | None,
        dwell: Sequence[float] | None,
        shares: bool = False,
        smoother: bool = False,
    ):
        self._law = law = SMOOTHER if smoother else USUAL
        self._points, self._times = np.array(points), None if times is None else np.array(times)
        self._dwell = np.zeros(len(points)) if dwell is None else np.array(dwell)
        self.attitudes = Attitudes(self._points[:, 3:])
        steps = np.hstack([np.diff(self._points[:, :3], axis=0), self.attitudes.steps])
        lengths = np.linalg.norm(steps, axis=1)
        if blend is None:
            turned = np.linalg.norm(self.attitudes.from_first, axis=1).max()
            blend = BLEND * float(np.hypot(np.linalg.norm(np.ptp(self._points[:, :3], axis=0)), turned))
        last, share = np.sqrt(size(steps)), lengths
        if self._times is not None:
            share = np.diff(self._times) - self._dwell[:-1]
            last = last if shares else 2 * share  # at most: a quarter of it longer at each end
        most = MOST * np.minimum(last[1:], last[:-1]) / (1 if self._times is None or shares else 2)
        left = np.where(self._dwell[1:-1] > 0, 0.0, law.largest_left(steps, last, most, blend))
        early, late = law.shares_of_time(left, lengths)
        alone = 1 - early - late
        # How long each leg moves, and the time from each point to the next: [s] if there are times, else in proportion.
        self._last = law.even_out(steps, last, early, late) if self._times is None else share / alone
        self._between = self._last * alone
        self._early = early  # how long before its first point each leg starts, in shares of its time
        self._overlaps = late[:-1] * self._last[:-1] + early[1:] * self._last[1:]  # (n - 2,)
        self._steps = np.vstack([steps, np.zeros(6)])
        self._weights = share / share.sum()  # how much of s belongs to each leg
        # s of each inner point, and where two legs begin and cease to move there, (n - 2,) each.
        self._corners = np.cumsum(self._weights)[:-1]
        self._begins = self._corners - self._weights[:-1] * law.law(self._overlaps / self._last[:-1])[0]
        self._ends = self._corners + self._weights[1:] * law.law(self._overlaps / self._last[1:])[0]

    def scale(self, duration: float) -> float:
        """Return the unit of `_between` [s] for a motion of `duration` [s]."""
        return 1.0 if self._times is not None else (duration - self._dwell.sum()) / self._between.sum()

    def knots(self, duration: float) -> np.ndarray:
        """Return the times at which the path passes its points, (n,) [s]; the arrival times for points with dwell."""
        if self._times is not None:
            return self._times
        return np.append(0.0, np.cumsum(self._between * self.scale(duration) + self._dwell[:-1]))

    def legs(self, duration: float) -> tuple[np.ndarray, np.ndarray]:
        """Return when each leg begins, and how long it lasts, (n - 1,) [s]."""
        last = self._last * self.scale(duration)
        return self.knots(duration)[:-1] + self._dwell[:-1] - self._early * last, last

    def at(self, times: np.ndarray, duration: float) -> Motion:
        """Return the motion of a task that lasts `duration` [s] at `times` [s].

        A search near the path asks for the same times again and again: the last few motions are remembered.
        """
        if len(times) > MOST_KNOWN:
            return self.evaluate(times, duration)
        return Motion(*(part.copy() for part in _remembered(self, times.tobytes(), duration)))

    def evaluate(self, times: np.ndarray, duration: float) -> Motion:
        """Return what `at` does, without looking whether it is known."""
        start, last = self.legs(duration)
        leg = np.minimum(np.searchsorted(start + last, times, side="right"), len(last) - 1)
        # After the last leg comes one that never starts.
        start, last = np.append(start, np.inf), np.append(last, 1.0)
        first, second = (_over(self._law, times, start[k], last[k]) for k in (leg, leg + 1))
        return self._motion(leg, first, second)

    @property
    def places(self) -> np.ndarray:
        """Return s of the points, (n,)."""
        return np.concatenate([[0.0], self._corners, [1.0]])

    def rests(self) -> list[tuple[float, float]]:
        """Return s of each point where the path must stop, and for how long [s]; its ends if it dwells there."""
        at = self.places
        inner = np.concatenate([[False], self._overlaps == 0, [False]])
        return [(float(at[k]), float(self._dwell[k])) for k in np.flatnonzero(inner | (self._dwell > 0))]

    def bends(self) -> np.ndarray:
        """Return s where two legs begin and cease to move together, (n, 2)."""
        return np.stack([self._begins, self._ends], axis=1)[self._overlaps > 0]

    def by_fraction(self, s: np.ndarray) -> Motion:
        """Return pose and derivatives by s, which is the sum of what all legs have done, by `_weights`.

        On a straight piece s is in proportion to the length, or with times to the time, and nowhere but at `rests` is
        the derivative by s zero. It is continuous from the right.
        """
        return self._motion(*self._progress(np.asarray(s, dtype=float)))

    def _progress(self, s: np.ndarray) -> tuple[np.ndarray, Progress, Progress]:
        """Return where a motion is at s: in which leg, and what is done of it and of the next one."""
        weights, last = self._weights, self._last
        leg = np.searchsorted(self._ends, s, side="right")
        one, zero = np.ones_like(s), np.zeros_like(s)
        start = np.append(0.0, self._corners)[leg]
        first = (np.clip((s - start) / weights[leg], 0.0, 1.0), one / weights[leg], zero.copy())
        second = (zero.copy(), zero.copy(), zero.copy())
        curved = np.flatnonzero(s > np.append(self._begins, np.inf)[leg])
        if curved.size:
            k = leg[curved]
            before, after = (weights[k], last[k]), (weights[k + 1], last[k + 1])
            both = _through(self._law, s[curved] - self._corners[k], self._overlaps[k], before, after)
            for part, values in zip((*first, *second), both, strict=True):
                part[curved] = values
        return leg, first, second

    def _motion(self, leg: np.ndarray, first: Progress, second: Progress) -> Motion:
        steps = self._steps[:, :3]
        pose, velocity, acceleration = (
            first[k][:, None] * steps[leg] + second[k][:, None] * steps[leg + 1] for k in range(3)
        )
        turned = self.attitudes.along(leg, first, second)
        turned = turned._replace(pose=nearest_turn(turned.pose, self._near(leg, first, second)))
        position = Motion(pose + self._points[leg, :3], velocity, acceleration)
        return Motion(*(np.hstack(parts) for parts in zip(position, turned, strict=True)))

    @cached_property
    def angles(self) -> tuple[np.ndarray, np.ndarray]:
        """Return points s along the path, (k,), and (roll, pitch, yaw) there without jumps, (k, 3)."""
        edges = self.places
        s = np.append((edges[:-1, None] + np.diff(edges)[:, None] * np.arange(LOOKS) / LOOKS).ravel(), 1.0)
        raw = self.attitudes.along(*self._progress(s)).pose
        return s, np.unwrap(np.vstack([self._points[0, 3:], raw]), axis=0)[1:]

    def _near(self, leg: np.ndarray, first: Progress, second: Progress) -> np.ndarray:
        """Return (roll, pitch, yaw) near those of a progress, from `angles`, (n, 3)."""
        if self.attitudes.constant:
            return self._points[:1, 3:]
        weights = np.append(self._weights, 0.0)
        s = np.append(0.0, np.cumsum(self._weights))[leg] + weights[leg] * first[0] + weights[leg + 1] * second[0]
        places, angles = self.angles
        return np.stack([np.interp(s, places, column) for column in angles.T], axis=1)


@lru_cache(maxsize=8)
def _remembered(legs: Legs, times: bytes, duration: float) -> Motion:
    return legs.evaluate(np.frombuffer(times), duration)


def _over(law: Overlap, times: np.ndarray, start: np.ndarray, last: np.ndarray) -> Progress:
    """Return what a leg has done at `times`, with two derivatives by time."""
    done, rate, rate_rate = law.law((times - start) / last)
    return done, rate / last, rate_rate / last**2


def _through(
    law: Overlap,
    offset: np.ndarray,
    overlap: np.ndarray,
    before: tuple[np.ndarray, np.ndarray],
    after: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, ...]:
    """Return what two legs have done where both move, with two derivatives by s; `offset` is s less the point's s.

    `before` and `after` are the weight of a leg in s and how long it lasts.
    """
    (weight_before, last_before), (weight_after, last_after) = before, after
    since = law.meeting(overlap, before, after, offset)
    left, left_rate, left_rate_rate = _over(law, overlap - since, np.zeros(1), last_before)
    done, rate, rate_rate = _over(law, since, np.zeros(1), last_after)
    s_rate = weight_before * left_rate + weight_after * rate
    s_rate_rate = weight_after * rate_rate - weight_before * left_rate_rate
    by_s, by_s_twice = 1 / s_rate, -s_rate_rate / s_rate**3
    ending = (1 - left, left_rate * by_s, -left_rate_rate * by_s**2 + left_rate * by_s_twice)
    return (*ending, done, rate * by_s, rate_rate * by_s**2 + rate * by_s_twice)
