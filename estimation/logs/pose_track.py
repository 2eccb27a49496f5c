"""`PoseTrack`: measured poses as a smooth motion, evaluated at times shifted by a clock offset."""

from __future__ import annotations

from copy import copy

import numpy as np
from scipy.spatial.transform import Rotation

from ...models import points
from .smoothing import NEIGHBOURS, PART, Polynomials, continuous, widest_parabola

SHORT = 5000  # samples of a part of a spline, whose coefficients need much memory
SHARED = 100  # and those beside it: the effect of one on another falls to a quarter from sample to sample
MOST = 11  # neighbours of a parabola
WIDEST = 5.0  # median times between measured poses; the motion inside a longer gap is not known


class PoseTrack:
    """Interpolate poses over time by cubic splines of position and quaternion.

    They are first smoothed by parabolas. Poses between samples would have less variance than those at samples, and a
    clock offset of half a sample would fit best for that reason alone: by half without smoothing, by 5 % after
    parabolas through 5 neighbours, by 0.1 % if these are 11 that fade. No more, as a wrong pose moves them all.

    - `times`: increasing, (N,) [s].
    - `position`, `rotation`: (N, 3) [m], (N, 3, 3).
    - `known`: samples at which the pose was measured, (N,) of bool; at least four.
    - `neighbours`: number of samples of a parabola; default: up to 11 with weights that fade, if the motion allows.
    """

    def __init__(
        self,
        times: np.ndarray,
        position: np.ndarray,
        rotation: np.ndarray,
        known: np.ndarray,
        neighbours: int | None = NEIGHBOURS,
    ):
        self._times, self._measured = times, times[known]
        measured = self._measured
        self._widest = WIDEST * float(np.median(np.diff(measured)))
        self._span = measured[0], measured[-1]
        quaternions = continuous(Rotation.from_matrix(rotation[known]).as_quat())
        values = np.hstack([position[known], quaternions])
        width = neighbours or widest_parabola(measured, values, MOST, moving=True)
        smooth = len(values) >= width
        # Samples over which noise of the poses is autocorrelated.
        self.smoothed = width * self._widest / WIDEST / float(np.median(np.diff(times)))
        self._values = (
            Polynomials(measured, width, fading=neighbours is None).values(values[None])[0] if smooth else values
        )
        self._slopes = slopes_of_spline(measured, self._values)
        self.speed = float(np.sqrt((self._slopes[:, :3] ** 2).sum(axis=1).mean()))  # root mean square [m/s]
        self._last: tuple[float, tuple[np.ndarray, ...]] | None = None

    def at_samples(self, rows: np.ndarray | slice) -> PoseTrack:
        """Return the same motion, evaluated at the times of some samples (k,)."""
        return self.at_times(self._times[rows])

    def at_times(self, times: np.ndarray) -> PoseTrack:
        """Return the same motion, evaluated at other times (k,) [s]."""
        other = copy(self)
        other._times, other._last = times, None
        return other

    def inside(self, clock: float) -> np.ndarray:
        """Return which samples lie between sufficiently close measured poses after the shift, (N,) of bool."""
        shifted = self._times + clock
        after = np.clip(np.searchsorted(self._measured, shifted), 1, len(self._measured) - 1)
        near = self._measured[after] - self._measured[after - 1] <= self._widest
        return (shifted >= self._span[0]) & (shifted <= self._span[1]) & near

    def at(self, clock: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return position (N, 3) [m], rotation (N, 3, 3), velocity (N, 3) [m/s] and rate (N, 3) in {G} [rad/s].

        `clock` is the time by which the clock of the poses is ahead of the lengths' clock [s].
        """
        if self._last is None or self._last[0] != clock:
            times = np.clip(self._times + clock, *self._span)
            parts = [self._at(times[first : first + PART]) for first in range(0, max(len(times), 1), PART)]
            self._last = clock, tuple(np.concatenate(of) for of in zip(*parts, strict=True))
        position, rotation, velocity, rate = self._last[1]
        return position, rotation, velocity, rate

    def _at(self, times: np.ndarray) -> tuple[np.ndarray, ...]:
        values, slopes = on_spline(self._measured, self._values, self._slopes, times)
        q, dq = values[:, 3:], slopes[:, 3:]
        length = np.linalg.norm(q, axis=1, keepdims=True)
        q, dq = q / length, dq / length
        v, w, dv, dw = q[:, :3], q[:, 3:], dq[:, :3], dq[:, 3:]
        rate = 2 * (w * dv - dw * v + np.cross(v, dv))  # the vector part of 2 dq q*, for rates in {G}
        return values[:, :3], Rotation.from_quat(q).as_matrix(), slopes[:, :3], rate


def on_spline(
    times: np.ndarray, values: np.ndarray, slopes: np.ndarray, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return values and derivatives (k, d) at other times (k,) of the spline with those (n, d) at its times (n,)."""
    before = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    begin, step = times[before], (times[before + 1] - times[before])[:, None]
    u = (at - begin)[:, None] / step
    first, begin_slope, end_slope = values[before], slopes[before], slopes[before + 1]
    chord = (values[before + 1] - first) / step
    square, cube = 3 * chord - 2 * begin_slope - end_slope, begin_slope + end_slope - 2 * chord
    return first + step * u * (begin_slope + u * (square + u * cube)), begin_slope + u * (2 * square + 3 * u * cube)


def slopes_of_spline(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the derivatives of the cubic spline through values (n, d) at their times (n,), not-a-knot at its ends.

    The spline is made of overlapping parts, because its coefficients need four times the memory of the values. The
    samples outside the overlap would change the derivatives by less than rounding.
    """
    from scipy.interpolate import CubicSpline

    count, result = len(times), np.empty(values.shape)
    for first in range(0, count, SHORT):
        last = min(first + SHORT, count)
        begin, end = max(min(first, count - SHARED) - SHARED, 0), min(last + SHARED, count)
        curve = CubicSpline(times[begin:end], values[begin:end])
        result[first:last] = curve(times[first:last], 1)
    return result


def track_of(times: np.ndarray, poses: np.ndarray) -> tuple[PoseTrack, int]:
    """Return poses (N, 6), nan where not measured, as a track as smooth as their noise allows, and its neighbours."""
    known = np.asarray(np.isfinite(poses).all(axis=1))
    turning = np.hstack([poses[known, :3], np.unwrap(poses[known, 3:], axis=0)])
    neighbours, filled = widest_parabola(times[known], turning), np.where(known[:, None], poses, 0.0)
    return PoseTrack(times, filled[:, :3], points.rotations(filled[:, 3:]), known, neighbours), neighbours


def unit_quaternions(values: np.ndarray) -> np.ndarray:
    """Return quaternions (N, 4) of unit length, of quaternions or of angles (N, 3) [rad]; nan where not measured."""
    known = np.isfinite(values).all(axis=1)
    result = np.full((len(values), 4), np.nan)
    given = values[known]
    result[known] = given if values.shape[1] == 4 else Rotation.from_matrix(points.rotations(given)).as_quat()
    size = np.linalg.norm(result, axis=1, keepdims=True)
    return np.where(np.abs(size - 1) < 0.1, result / np.where(size > 0, size, 1.0), np.nan)
