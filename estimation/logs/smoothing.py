"""`Polynomials`, `widest_parabola`: smoothing by polynomials through neighbours, no wider than their noise allows."""

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np

SPAN = 0.1  # [s] to each side of a sample, over which a motion is a parabola
FEWEST = 2  # samples to each side
MOST = 25
NEIGHBOURS = 5  # samples of a parabola
LEFT = 17 / 35  # of the variance of noise, by parabolas through five samples
LONGEST = 0.5  # [s] of a parabola
APART = 5  # samples to each side, between which a motion is seen
PART = 20_000  # samples that are smoothed together
PAUSE, LONG = 10.0, 1.0  # median times between samples, and [s], over which no parabola extends if both are exceeded
ROUGHER = 1.1  # times their noise: what samples may deviate from the smooth curve through them


class Fitted(NamedTuple):
    """Values, first and second derivatives, (N, d), and the standard deviation of each, (3, N, d): larger at ends."""

    values: np.ndarray
    slopes: np.ndarray
    bends: np.ndarray
    noise: np.ndarray


def continuous(quaternions: np.ndarray) -> np.ndarray:
    """Return quaternions (N, 4) whose signs follow from those before: q and -q are the same rotation."""
    flips = np.where(np.einsum("ni,ni->n", quaternions[1:], quaternions[:-1]) < 0, -1.0, 1.0)
    return quaternions * np.cumprod(np.append(1.0, flips))[:, None]


def after_pauses(times: np.ndarray) -> np.ndarray:
    """Return the first sample after each pause of a log with times (N,) [s]."""
    apart = np.diff(times)
    return np.flatnonzero(apart > max(PAUSE * float(np.median(apart)), LONG)) + 1 if len(apart) else np.zeros(0, int)


class _Part(NamedTuple):
    """Polynomials about n samples.

    Attributes:
        rows: Samples of each polynomial, (n, w).
        unit: Unit of time of each, (n, 1) [s].
        shares: Coefficients per value of a sample, (n, degree + 1, w).
    """

    rows: np.ndarray
    unit: np.ndarray
    shares: np.ndarray


class Polynomials:
    """Polynomials of a degree by least squares through `width` neighbours of each sample, at times (N,) [s].

    Samples before and after a pause are no neighbours, unless those between two pauses are too few for a polynomial.
    If `fading`, farther neighbours count less (Hann window). The `hollow` nearest samples are left out. Polynomials are
    computed for some samples at a time, because those of a million samples would take more than a gigabyte.
    """

    def __init__(self, times: np.ndarray, width: int, degree: int = 2, fading: bool = False, hollow: int = 0):
        self._times, self._width, self._degree, self._fading, count = times, width, degree, fading, len(times)
        self._hollow = hollow
        ends = np.concatenate([[0], after_pauses(times), [count]])
        sizes = np.diff(ends)
        self._first = np.repeat(np.where(sizes < width, 0, ends[:-1]), sizes)  # neighbour that each sample may have
        self._last = np.repeat(np.where(sizes < width, count, ends[1:]), sizes)
        self._at_once = PART * (2 * MOST + 1) // max(width, 2 * MOST + 1)
        self._only = self._part(0) if count <= self._at_once else None

    def _part(self, begin: int) -> _Part:
        count, width = len(self._times), self._width
        at = np.arange(begin, min(begin + self._at_once, count))
        rows = np.clip(at - width // 2, self._first[at], self._last[at] - width)[:, None] + np.arange(width)
        apart = self._times[rows] - self._times[at, None]
        unit = np.abs(apart).max(axis=1, keepdims=True)
        basis = (apart / unit)[..., None] ** np.arange(self._degree + 1)
        transposed = np.swapaxes(basis, 1, 2)
        if self._fading:
            far = np.minimum(np.abs(rows - at[:, None]) / (width // 2 + 1), (width // 2) / (width // 2 + 1))
            transposed = transposed * (np.cos(np.pi / 2 * far) ** 2)[:, None]
        if self._hollow:
            transposed = transposed * (np.abs(rows - at[:, None]) > self._hollow // 2)[:, None]
        return _Part(rows, unit, np.linalg.solve(transposed @ basis, transposed))

    def _parts(self) -> Iterator[_Part]:
        if self._only is not None:
            yield self._only
        else:
            yield from map(self._part, range(0, len(self._times), self._at_once))

    @cached_property
    def share(self) -> np.ndarray:
        """Return the share of the variance of noise that smoothed values keep, (N,)."""
        return np.concatenate([(part.shares[:, 0] ** 2).sum(axis=1) for part in self._parts()])

    def values(self, values: np.ndarray) -> np.ndarray:
        """Return smoothed values (k, N, d)."""
        parts = [[(part.shares[:, :1] @ one[part.rows])[:, 0] for one in values] for part in self._parts()]
        return np.concatenate(parts, axis=1)

    def fitted(self, values: np.ndarray) -> Fitted:
        """Return values (N, d) as the polynomials have them."""
        result, spread = np.empty((3, *values.shape)), np.empty((3, len(values)))
        end = 0
        for part in self._parts():
            begin, end = end, end + len(part.rows)
            units = np.hstack([np.ones_like(part.unit), part.unit, part.unit**2 / 2])  # (n, 3)
            shares = part.shares[:, :3] / units[:, :, None]
            result[:, begin:end] = np.swapaxes(shares @ values[part.rows], 0, 1)
            spread[:, begin:end] = np.linalg.norm(shares, axis=2).T
        own = 1 + spread[0] ** 2 if self._hollow else np.ones(len(values))  # of values at samples that are left out
        noise = np.sqrt(((values - result[0]) ** 2 / own[:, None]).mean(axis=0))
        return Fitted(result[0], result[1], result[2], spread[..., None] * noise)


def within(times: np.ndarray, span: float = SPAN, most: int = MOST) -> int:
    """Return the number of neighbours of a polynomial over `span` [s], and at most `most` samples, to each side."""
    return 2 * int(np.clip(span / np.median(np.diff(times)), FEWEST, min(most, (len(times) - 1) // 2))) + 1


def smooth(times: np.ndarray, values: np.ndarray, neighbours: int = NEIGHBOURS) -> np.ndarray:
    """Smooth values (n, d) by least-squares parabolas through each and its nearest neighbours."""
    return values if len(times) < neighbours else Polynomials(times, neighbours).values(values[None])[0]


def noise_of(times: np.ndarray, values: np.ndarray) -> float:
    """Return the standard deviation of white noise in values (n, d) that are smooth otherwise, over all d."""
    if len(times) <= NEIGHBOURS or not values.size:
        return 0.0
    return float(np.sqrt(np.mean(roughness(times, values) ** 2) / (1 - LEFT)))


def widest_parabola(times: np.ndarray, values: np.ndarray, most: int = 51, moving: bool = False) -> int:
    """Return through how many neighbours parabolas smooth values (n, d) without deviating beyond their noise.

    `most` is the largest number, `moving` as for `roughness`.
    """
    if len(times) <= NEIGHBOURS:
        return NEIGHBOURS
    apart = float(np.median(np.diff(times)))
    noise = np.maximum(roughness(times, values, moving=moving) / np.sqrt(1 - LEFT), 1e-12)
    for n in (51, 31, 21, 15, 11, 7):
        if n > most or n * apart > LONGEST or len(times) < 4 * n:
            continue
        if (roughness(times, values, n, moving) <= ROUGHER * noise).all():
            return n
    return NEIGHBOURS


def roughness(times: np.ndarray, values: np.ndarray, neighbours: int = NEIGHBOURS, moving: bool = False) -> np.ndarray:
    """Return by how much values (n, d) deviate from parabolas through so many neighbours, (d,), robustly.

    If `moving`, samples count by how fast the values change: long rests would hide what the motion is like.
    """
    half = neighbours // 2
    off = 1.4826 * np.abs(values - smooth(times, values, neighbours))[half:-half]
    if not moving:
        return np.median(off, axis=0)
    at, last = np.arange(half, half + len(off)), len(values) - 1
    steps = np.abs(values[np.minimum(at + APART, last)] - values[np.maximum(at - APART, 0)])
    order = np.argsort(off, axis=0)
    reached = np.cumsum((steps / np.maximum(steps.mean(axis=0), 1e-300)).sum(axis=1)[order], axis=0)
    median = np.take_along_axis(order, (reached < reached[-1] / 2).sum(axis=0)[None], axis=0)
    return np.take_along_axis(off, median, axis=0)[0]


def spline_of(times: np.ndarray, values: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return the cubic spline through values (n, k) at times (n,), extended by lines, as cubics would diverge."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(times, values)

    def at(wanted: np.ndarray) -> np.ndarray:
        near = wanted.clip(times[0], times[-1])
        return spline(near) + spline(near, 1) * (wanted - near)[..., None]

    return at
