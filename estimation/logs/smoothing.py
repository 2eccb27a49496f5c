"""Smooth samples by parabolas through neighbours, no wider than their noise allows: `noise_of`, `widest_parabola`."""

import numpy as np

NEIGHBOURS = 5  # samples of a parabola
LEFT = 17 / 35  # of the variance of noise, by parabolas through five samples
LONGEST = 0.5  # [s] of a parabola
ROUGHER = 1.1  # times their noise: what samples may deviate from the smooth curve through them


def smooth(times: np.ndarray, values: np.ndarray, neighbours: int = NEIGHBOURS) -> np.ndarray:
    """Smooth values (n, d) by least-squares parabolas through each and its nearest neighbours."""
    count = len(times)
    if count < neighbours:
        return values
    first = np.clip(np.arange(count) - neighbours // 2, 0, count - neighbours)
    rows = first[:, None] + np.arange(neighbours)  # (n, 5)
    apart = times[rows] - times[:, None]
    apart /= np.abs(apart).max(axis=1, keepdims=True)
    basis = np.stack([np.ones_like(apart), apart, apart**2], axis=2)  # (n, 5, 3)
    transposed = np.swapaxes(basis, 1, 2)
    shares = np.linalg.solve(transposed @ basis, transposed)[:, 0]  # (n, 5): the value at 0 of the parabola
    return np.einsum("nk,nkd->nd", shares, values[rows])


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
