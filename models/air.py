"""Winds over time: constant, paper F's trapezoid with noise, and Dryden turbulence; velocities of the air in {G}.

Each is a function of times and gives (n, 3) in [m/s]. What is random is seeded: the same seed gives the same wind.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError


def constant(times: np.ndarray, velocity: Sequence[float]) -> np.ndarray:
    """The same wind at all times, (n, 3) [m/s]."""
    return np.tile(np.asarray(velocity, dtype=float), (len(times), 1))


def trapezoid(
    times: np.ndarray,
    peak: Sequence[float] = (5.0, 6.0, 2.0),
    corners: Sequence[float] = (0.1, 0.3, 0.7, 0.9),
    noise: float = 0.5,
    seed: int = 0,
) -> np.ndarray:
    """Paper F's gust, (n, 3) [m/s]: rising, steady, falling, with Gaussian noise cut at +- `noise`.

    Parameters
    ----------
    times
        (n,), rising [s]; the trapezoid stretches over all of them.
    peak
        The steady wind [m/s]: (5, 6, 2) in paper F, section VI.
    corners
        Where in [0, 1] of the time the wind begins to rise, is steady, begins to fall, is gone: not given in the
        paper, assumed.
    noise
        Half-width of the noise [m/s]; its standard deviation is a third of it, so that few samples are cut.
    """
    times = np.asarray(times, dtype=float)
    if list(corners) != sorted(corners) or len(corners) != 4:
        raise InputError(f"corners: {corners!r}; accepted: four rising numbers in [0, 1]")
    share = (times - times[0]) / max(times[-1] - times[0], 1e-12)
    envelope = np.interp(share, corners, [0.0, 1.0, 1.0, 0.0])
    random = np.random.default_rng(seed).normal(scale=noise / 3 if noise else 1.0, size=(len(times), 3))
    return envelope[:, None] * np.asarray(peak, dtype=float) + np.clip(random, -noise, noise)


def dryden(
    times: np.ndarray,
    mean: Sequence[float],
    intensity: Sequence[float] = (1.0, 1.0, 0.5),
    scale: Sequence[float] = (200.0, 200.0, 50.0),
    seed: int = 0,
) -> np.ndarray:
    """Dryden turbulence about a mean wind, (n, 3) [m/s], for a body that rests in it.

    White noise through the forming filters of MIL-F-8785C, sampled exactly, stationary from the first sample on:

        along the mean wind  sigma sqrt(2 T) / (1 + T s),   across it  sigma sqrt(T) (1 + sqrt(3) T s) / (1 + T s)^2

    with T = L / V. "Along" is the direction of the mean wind's horizontal part, "up" is z, the third is across both.

    Parameters
    ----------
    times
        (n,), rising in equal steps [s].
    mean
        Mean wind in {G} [m/s], of speed V > 0.
    intensity
        sigma along, across and up [m/s].
    scale
        Scale lengths L along, across and up [m].

    Raises
    ------
    InputError
        If the mean wind has no horizontal part, or the times do not rise in equal steps.
    """
    times, mean_wind = np.asarray(times, dtype=float), np.asarray(mean, dtype=float)
    speed = float(np.linalg.norm(mean_wind))
    if not np.linalg.norm(mean_wind[:2]) > 0:
        raise InputError(f"mean: {tuple(mean)!r} has no horizontal part; accepted: a wind along the ground [m/s]")
    steps = np.diff(times)
    if len(steps) and not (steps.min() > 0 and np.ptp(steps) < 1e-6 * steps.mean()):
        raise InputError("times: must rise in equal steps")
    step = float(steps.mean()) if len(steps) else 1.0
    rng = np.random.default_rng(seed)
    gusts = np.empty((len(times), 3))
    for axis, (sigma, length) in enumerate(zip(intensity, scale, strict=True)):
        T = length / speed
        if axis == 0:
            A, b, c = np.array([[-1 / T]]), np.array([1.0]), sigma * np.sqrt(2 * T) / T * np.array([1.0])
        else:
            A, b = np.array([[0.0, 1.0], [-1 / T**2, -2 / T]]), np.array([0.0, 1.0])
            c = sigma * np.sqrt(T) / T**2 * np.array([1.0, np.sqrt(3) * T])
        gusts[:, axis] = _filtered_noise(A, b, c, step, len(times), rng)
    along = np.append(mean_wind[:2], 0.0) / np.linalg.norm(mean_wind[:2])
    up = np.array([0.0, 0.0, 1.0])
    return mean_wind + gusts @ np.stack([along, np.cross(up, along), up])


def _filtered_noise(
    A: np.ndarray, b: np.ndarray, c: np.ndarray, step: float, count: int, rng: np.random.Generator
) -> np.ndarray:
    """Sample c . x at `count` times of dx = A x dt + b dW, in its stationary distribution."""
    from scipy.linalg import expm, solve_continuous_lyapunov

    stationary = solve_continuous_lyapunov(A, -np.outer(b, b))
    transition = expm(A * step)
    innovation = stationary - transition @ stationary @ transition.T
    x = np.linalg.cholesky(stationary) @ rng.normal(size=len(b))
    root = np.linalg.cholesky(innovation)
    values = np.empty(count)
    for k, kick in enumerate(rng.normal(size=(count, len(b)))):
        values[k] = c @ x
        x = transition @ x + root @ kick
    return values
