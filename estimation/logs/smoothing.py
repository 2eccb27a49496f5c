"""Smooth samples by parabolas through neighbours, no wider than their noise allows: `Parabolas`, `widest_parabola`."""

from typing import NamedTuple

import numpy as np

SPAN = 0.1  # [s] to each side of a sample, over which a motion is a parabola
FEWEST = 2  # samples to each side
MOST = 25
NEIGHBOURS = 5  # samples of a parabola
LEFT = 17 / 35  # of the variance of noise, by parabolas through five samples
LONGEST = 0.5  # [s] of a parabola
PART = 20_000  # samples that are smoothed together
ROUGHER = 1.1  # times their noise: what samples may deviate from the smooth curve through them


class Fitted(NamedTuple):
    """Values, first and second derivatives, (N, d), and the standard deviation of each, (3, d)."""

    values: np.ndarray
    slopes: np.ndarray
    bends: np.ndarray
    noise: np.ndarray


def continuous(quaternions: np.ndarray) -> np.ndarray:
    """Return quaternions (N, 4) whose signs follow from those before: q and -q are the same rotation."""
    flips = np.where(np.einsum("ni,ni->n", quaternions[1:], quaternions[:-1]) < 0, -1.0, 1.0)
    return quaternions * np.cumprod(np.append(1.0, flips))[:, None]


class Parabolas:
    """Parabolas by least squares through `width` neighbours of each sample, at times (N,) [s]."""

    def __init__(self, times: np.ndarray, width: int):
        count = len(times)
        first = np.clip(np.arange(count) - width // 2, 0, count - width)
        self._rows = first[:, None] + np.arange(width)  # (N, width)
        apart = times[self._rows] - times[:, None]
        self._unit = np.abs(apart).max(axis=1, keepdims=True)
        basis = np.stack([np.ones_like(apart), apart / self._unit, (apart / self._unit) ** 2], axis=2)
        transposed = np.swapaxes(basis, 1, 2)
        self._shares = np.linalg.solve(transposed @ basis, transposed)  # (N, 3, width)

    @property
    def share(self) -> np.ndarray:
        """Return the share of the variance of noise that smoothed values keep, (N,)."""
        return (self._shares[:, 0] ** 2).sum(axis=1)

    def values(self, values: np.ndarray) -> np.ndarray:
        """Return smoothed values (k, N, d)."""
        return np.stack([(self._shares[:, :1] @ one[self._rows])[:, 0] for one in values])

    def fitted(self, values: np.ndarray) -> Fitted:
        """Return values (N, d) as the parabolas have them."""
        parts = self._shares @ values[self._rows]  # (N, 3, d)
        noise = np.sqrt(((values - parts[:, 0]) ** 2).mean(axis=0))
        units = (1.0, self._unit, self._unit**2 / 2)
        spread = [np.median(np.linalg.norm(self._shares[:, k], axis=1) / np.ravel(units[k])) for k in range(3)]
        return Fitted(parts[:, 0], parts[:, 1] / units[1], parts[:, 2] / units[2], np.outer(spread, noise))


def within(times: np.ndarray, span: float = SPAN) -> int:
    """Return the number of neighbours of a parabola that extends over `span` [s] to each side."""
    return 2 * int(np.clip(span / np.median(np.diff(times)), FEWEST, min(MOST, (len(times) - 1) // 2))) + 1


def smooth(times: np.ndarray, values: np.ndarray, neighbours: int = NEIGHBOURS) -> np.ndarray:
    """Smooth values (n, d) by least-squares parabolas through each and its nearest neighbours."""
    count = len(times)
    if count < neighbours:
        return values
    result = np.empty(values.shape)
    for first in range(0, count, PART):  # parabolas of all samples at once would need much memory
        last = min(first + PART, count)
        begin, end = max(min(first, count - neighbours) - neighbours, 0), min(last + neighbours, count)
        part = Parabolas(times[begin:end], neighbours).values(values[None, begin:end])[0]
        result[first:last] = part[first - begin : last - begin]
    return result


def noise_of(times: np.ndarray, values: np.ndarray) -> float:
    """Return the standard deviation of white noise in values (n, d) that are smooth otherwise, over all d."""
    if len(times) <= NEIGHBOURS or not values.size:
        return 0.0
    return float(np.sqrt(np.mean(_roughness(times, values, NEIGHBOURS) ** 2) / (1 - LEFT)))


def widest_parabola(times: np.ndarray, values: np.ndarray) -> int:
    """Return through how many neighbours parabolas smooth values (n, d) without deviating beyond their noise."""
    if len(times) <= NEIGHBOURS:
        return NEIGHBOURS
    apart = float(np.median(np.diff(times)))
    noise = np.maximum(_roughness(times, values, NEIGHBOURS) / np.sqrt(1 - LEFT), 1e-12)
    for n in (51, 31, 21, 15, 11, 7):
        if n * apart <= LONGEST and len(times) >= 4 * n and (_roughness(times, values, n) <= ROUGHER * noise).all():
            return n
    return NEIGHBOURS


def _roughness(times: np.ndarray, values: np.ndarray, neighbours: int) -> np.ndarray:
    """Return by how much values (n, d) deviate from parabolas through so many neighbours, (d,), robustly."""
    half = neighbours // 2
    return 1.4826 * np.median(np.abs(values - smooth(times, values, neighbours))[half:-half], axis=0)
