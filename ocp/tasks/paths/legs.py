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

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ....base.display import Displayed
from .attitudes import Attitudes, nearest_turn
from .leg_law import leg_law
from .motion import Motion
from .overlap import MOST, even_out, largest_left, meeting, shares_of_time, size

LOOKS = 48  # at the angles of each leg


@dataclass(frozen=True)
class Progress(Displayed):
    """The progress of a motion along legs: those before `leg` are done, `leg` and the one after it move.

    `first` and `second` are the shares of these two that are done, with two derivatives, (n,) each.
    """

    leg: np.ndarray
    first: tuple[np.ndarray, np.ndarray, np.ndarray]
    second: tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Legs(Displayed):
    """Straight legs through points.

    Attributes
    ----------
    points
        (n, 6) poses.
    blend
        The largest distance at which the path passes its points [m].
    times
        (n,), the times at which it passes them [s]; default: any duration, all legs with the same
        peak acceleration.
    dwell
        (n,), dwell time at each [s].
    """

    points: np.ndarray
    blend: float
    times: np.ndarray | None
    dwell: np.ndarray

    def blended(self, share: float) -> Legs:
        """Return the same legs with a blend of this share of the span of the points."""
        box = np.ptp(self.points[:, :3], axis=0)
        turned = np.linalg.norm(self.attitudes.from_first, axis=1).max()
        return replace(self, blend=share * float(np.hypot(np.linalg.norm(box), turned)))

    @cached_property
    def attitudes(self) -> Attitudes:
        """Return the attitudes of the points and the rotations between them."""
        return Attitudes(self.points[:, 3:])

    @cached_property
    def steps(self) -> np.ndarray:
        """Return the positions and rotation vectors of the legs, (n - 1, 6) [m, rad]."""
        return np.hstack([np.diff(self.points[:, :3], axis=0), self.attitudes.steps])

    @cached_property
    def lengths(self) -> np.ndarray:
        """Return the lengths of the legs, (n - 1,)."""
        return np.linalg.norm(self.steps, axis=1)

    @cached_property
    def _between(self) -> np.ndarray:
        """Return the time from each point to the next, (n - 1,): in [s] if there are times, else in proportion."""
        if self.times is not None:
            return np.diff(self.times) - self.dwell[:-1]
        return self._last * (1 - self._early - self._late)

    @cached_property
    def _last(self) -> np.ndarray:
        """Return how long each leg moves, (n - 1,), in the unit of `_between`."""
        if self.times is not None:
            return self._between / (1 - self._early - self._late)
        return even_out(self.steps, np.sqrt(size(self.steps)), self._early, self._late)

    @cached_property
    def _shares(self) -> tuple[np.ndarray, np.ndarray]:
        """Return how early each leg starts and how late it ends, (n - 1,) each, in shares of its time."""
        # With times a leg lasts at most twice the time between its points: a quarter of it longer at each end.
        last = np.sqrt(size(self.steps)) if self.times is None else 2 * self._between
        most = MOST * np.minimum(last[1:], last[:-1]) / (1 if self.times is None else 2)
        left = largest_left(self.steps, last, most, self.blend)
        return shares_of_time(np.where(self.dwell[1:-1] > 0, 0.0, left), self.lengths)

    @property
    def _early(self) -> np.ndarray:
        return self._shares[0]

    @property
    def _late(self) -> np.ndarray:
        return self._shares[1]

    @cached_property
    def _overlaps(self) -> np.ndarray:
        """Return how long the legs overlap at each inner point, (n - 2,), in the unit of `_between`."""
        return self._late[:-1] * self._last[:-1] + self._early[1:] * self._last[1:]

    def scale(self, duration: float) -> float:
        """Return the unit of `_between` [s] for a motion of `duration` [s]."""
        return 1.0 if self.times is not None else (duration - self.dwell.sum()) / self._between.sum()

    def knots(self, duration: float) -> np.ndarray:
        """Return the times at which the path passes its points, (n,) [s]; the arrival times for points with dwell."""
        if self.times is not None:
            return self.times
        return np.concatenate([[0.0], np.cumsum(self._between * self.scale(duration) + self.dwell[:-1])])

    def at(self, times: np.ndarray, duration: float) -> Motion:
        """Return the motion of a task that lasts `duration` [s] at `times` [s]."""
        last = self._last * self.scale(duration)
        start = self.knots(duration)[:-1] + self.dwell[:-1] - self._early * last
        leg = np.minimum(np.searchsorted(start + last, times, side="right"), len(last) - 1)
        # After the last leg comes one that never starts.
        start, last = np.append(start, np.inf), np.append(last, 1.0)
        return self._motion(Progress(leg, *(_over(times, start[k], last[k]) for k in (leg, leg + 1))))

    @cached_property
    def _weights(self) -> np.ndarray:
        """Return how much of s belongs to each leg, (n - 1,); with times, as much as of the time."""
        return (self.lengths if self.times is None else self._between) / (
            self.lengths.sum() if self.times is None else self._between.sum()
        )

    @cached_property
    def _corners(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return s of each inner point, and where two legs begin and cease to move there, (n - 2,) each."""
        at = np.cumsum(self._weights)[:-1]
        overlaps, last, weights = self._overlaps, self._last, self._weights
        first = at - weights[:-1] * leg_law(overlaps / last[:-1])[0]
        return at, first, at + weights[1:] * leg_law(overlaps / last[1:])[0]

    @property
    def places(self) -> np.ndarray:
        """Return s of the points, (n,)."""
        return np.concatenate([[0.0], self._corners[0], [1.0]])

    def rests(self) -> list[tuple[float, float]]:
        """Return s of each point where the path must stop, and for how long [s]; its ends if it dwells there."""
        at = self.places
        inner = np.concatenate([[False], self._overlaps == 0, [False]])
        return [(float(at[k]), float(self.dwell[k])) for k in np.flatnonzero(inner | (self.dwell > 0))]

    def bends(self) -> np.ndarray:
        """Return s where two legs begin and cease to move together, (n, 2)."""
        return np.stack(self._corners[1:], axis=1)[self._overlaps > 0]

    def by_fraction(self, s: np.ndarray) -> Motion:
        """Return pose and derivatives by s, which is the sum of what all legs have done, by `_weights`.

        On a straight piece s is in proportion to the length, and nowhere but at `rests` is the derivative by s zero. It
        is continuous from the right.
        """
        return self._motion(self._progress(np.asarray(s, dtype=float)))

    def _progress(self, s: np.ndarray) -> Progress:
        at, begins, ends = self._corners
        weights, last = self._weights, self._last
        leg = np.searchsorted(ends, s, side="right")
        one, zero = np.ones_like(s), np.zeros_like(s)
        start = np.append(0.0, at)[leg]
        first = (np.clip((s - start) / weights[leg], 0.0, 1.0), one / weights[leg], zero.copy())
        second = (zero.copy(), zero.copy(), zero.copy())
        curved = np.flatnonzero(s > np.append(begins, np.inf)[leg])
        if curved.size:
            k = leg[curved]
            before, after = (weights[k], last[k]), (weights[k + 1], last[k + 1])
            both = _through(s[curved] - at[k], self._overlaps[k], before, after)
            for part, values in zip((*first, *second), both, strict=True):
                part[curved] = values
        return Progress(leg, first, second)

    def _motion(self, progress: Progress) -> Motion:
        """Return the motion of a progress."""
        leg, first, second = progress.leg, progress.first, progress.second
        steps = np.vstack([self.steps[:, :3], np.zeros(3)])
        pose, velocity, acceleration = (
            first[k][:, None] * steps[leg] + second[k][:, None] * steps[leg + 1] for k in range(3)
        )
        turned = self.attitudes.along(leg, first, second)
        turned = turned._replace(pose=nearest_turn(turned.pose, self._near(progress)))
        position = Motion(pose + self.points[leg, :3], velocity, acceleration)
        return Motion(*(np.hstack(parts) for parts in zip(position, turned, strict=True)))

    @cached_property
    def angles(self) -> tuple[np.ndarray, np.ndarray]:
        """Return points s along the path, (k,), and (roll, pitch, yaw) there without jumps, (k, 3)."""
        edges = self.places
        s = np.append((edges[:-1, None] + np.diff(edges)[:, None] * np.arange(LOOKS) / LOOKS).ravel(), 1.0)
        progress = self._progress(s)
        raw = self.attitudes.along(progress.leg, progress.first, progress.second).pose
        return s, np.unwrap(np.vstack([self.points[0, 3:], raw]), axis=0)[1:]

    def _near(self, progress: Progress) -> np.ndarray:
        """Return (roll, pitch, yaw) near those of a progress, from `angles`, (n, 3)."""
        if self.attitudes.constant:
            return self.points[:1, 3:]
        weights = np.append(self._weights, 0.0)
        done = np.append(0.0, np.cumsum(self._weights))
        leg = progress.leg
        s = done[leg] + weights[leg] * progress.first[0] + weights[leg + 1] * progress.second[0]
        places, angles = self.angles
        return np.stack([np.interp(s, places, column) for column in angles.T], axis=1)


def _over(times: np.ndarray, start: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what a leg has done at `times`, with two derivatives by time."""
    done, rate, rate_rate = leg_law((times - start) / last)
    return done, rate / last, rate_rate / last**2


def _through(
    offset: np.ndarray, overlap: np.ndarray, before: tuple[np.ndarray, np.ndarray], after: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, ...]:
    """Return what two legs have done where both move, with two derivatives by s; `offset` is s less that of the point.

    `before` and `after` are the weight of a leg in s and how long it lasts.
    """
    (weight_before, last_before), (weight_after, last_after) = before, after
    since = meeting(overlap, before, after, offset)
    left, left_rate, left_rate_rate = _over(overlap - since, np.zeros(1), last_before)
    done, rate, rate_rate = _over(since, np.zeros(1), last_after)
    s_rate = weight_before * left_rate + weight_after * rate
    s_rate_rate = weight_after * rate_rate - weight_before * left_rate_rate
    by_s, by_s_twice = 1 / s_rate, -s_rate_rate / s_rate**3
    return (
        1 - left,
        left_rate * by_s,
        -left_rate_rate * by_s**2 + left_rate * by_s_twice,
        done,
        rate * by_s,
        rate_rate * by_s**2 + rate * by_s_twice,
    )
