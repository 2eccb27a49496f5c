"""Winds over time: constant, paper F's trapezoid with noise, and Dryden turbulence; velocities of the air in {G}.

Each is a function of times and returns (n, 3) in [m/s]. Random parts are seeded: the same seed gives the same wind.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ..base.inputs import InputError, finite_array, shown


def constant(times: np.ndarray, velocity: Sequence[float]) -> np.ndarray:
    """Return the same wind at all times, (n, 3) [m/s]."""
    return np.tile(_numbers("velocity", velocity, 3), (len(_numbers("times", times)), 1))


def trapezoid(
    times: np.ndarray,
    peak: Sequence[float] = (5.0, 6.0, 2.0),
    corners: Sequence[float] = (0.1, 0.3, 0.7, 0.9),
    noise: float = 0.5,
    seed: int = 0,
) -> np.ndarray:
    """Compute paper F's gust, (n, 3) [m/s]: rising, steady, falling, with Gaussian noise cut at +- `noise`.

    - `times`: (n,), rising [s]; the trapezoid stretches over all of them.
    - `peak`: the steady wind [m/s]: (5, 6, 2) in paper F, section VI.
    - `corners`: fractions of the time, in [0, 1], at which the wind begins to rise, is steady, begins to fall and is
      zero. They are assumed: the paper does not give them.
    - `noise`: half-width of the noise [m/s]; its standard deviation is a third of it, so that few samples are cut.
    """
    times, places = _numbers("times", times), _numbers("corners", corners, 4, 0.0)
    if (np.diff(places) < 0).any() or places[-1] > 1:
        raise InputError(f"corners must be four rising numbers from 0 to 1, got {corners!r}")
    if (np.diff(times) < 0).any():
        raise InputError("times must increase, got times that decrease")
    noise = float(_numbers("noise", [noise], 1, 0.0)[0])
    share = (times - times[0]) / max(times[-1] - times[0], 1e-12)
    envelope = np.interp(share, places, [0.0, 1.0, 1.0, 0.0])
    random = np.random.default_rng(seed).normal(scale=noise / 3 if noise else 1.0, size=(len(times), 3))
    return envelope[:, None] * _numbers("peak", peak, 3) + np.clip(random, -noise, noise)


def dryden(
    times: np.ndarray,
    mean: Sequence[float],
    intensity: Sequence[float] = (1.0, 1.0, 0.5),
    scale: Sequence[float] = (200.0, 200.0, 50.0),
    seed: int = 0,
) -> np.ndarray:
    """Compute Dryden turbulence about a mean wind, (n, 3) [m/s], for a body that rests in it.

    White noise passes the forming filters of MIL-F-8785C, sampled exactly, stationary from the first sample on:

        along the mean wind  sigma sqrt(2 T) / (1 + T s),   across it  sigma sqrt(T) (1 + sqrt(3) T s) / (1 + T s)^2

    with T = L / V. "Along" is the direction of the mean wind's horizontal part, "up" is z, the third is across both.

    - `times`: (n,), rising in equal steps [s].
    - `mean`: mean wind in {G} [m/s], of speed V > 0.
    - `intensity`: sigma along, across and up [m/s].
    - `scale`: scale lengths L along, across and up [m].

    Raises `InputError` if the mean wind has no horizontal part, or the times do not rise in equal steps.
    """
    times, mean_wind = _numbers("times", times), _numbers("mean", mean, 3)
    sigmas, lengths = _numbers("intensity", intensity, 3, 0.0), _numbers("scale", scale, 3, 1e-9)
    speed = float(np.linalg.norm(mean_wind))
    if not np.linalg.norm(mean_wind[:2]) > 0:
        raise InputError(f"mean must be a wind [m/s] with a horizontal part, got {tuple(mean)!r}")
    steps = np.diff(times)
    if len(steps) and not (steps.min() > 0 and np.ptp(steps) < 1e-6 * steps.mean()):
        raise InputError("times must increase in equal steps, got unequal ones")
    rng = np.random.default_rng(seed)
    gusts = np.empty((len(times), 3))
    for axis in range(3):
        step = float(steps.mean()) * speed / lengths[axis] if len(steps) else 1.0  # in units of T
        filtered = _along if axis == 0 else _across
        gusts[:, axis] = sigmas[axis] * filtered(step, rng.normal(size=(len(times) + 1, 2)))
    along = np.append(mean_wind[:2], 0.0) / np.linalg.norm(mean_wind[:2])
    up = np.array([0.0, 0.0, 1.0])
    return mean_wind + gusts @ np.stack([along, np.cross(up, along), up])


def _along(step: float, noise: np.ndarray) -> np.ndarray:
    """Filter unit white noise by sqrt(2) / (1 + s), sampled every `step`, to variance one, by an exact recursion."""
    kicks = np.sqrt(-np.expm1(-2 * step)) * noise[:-1, 0]
    kicks[0] = noise[0, 0]
    return _decaying(float(np.exp(-step)), kicks)


def _across(step: float, noise: np.ndarray) -> np.ndarray:
    """Filter unit white noise by (1 + sqrt(3) s) / (1 + s)^2, sampled every `step`, to variance one."""
    h = min(step, 40.0)
    kicks = noise[:-1] @ _covariance_root(h).T
    kicks[0] = noise[0] / 2  # in its stationary distribution x and dx have variance 1/4
    # Over a step x and dx turn into e^-h (x + h (x + dx)) and e^-h (dx - h (x + dx)), so that their sum only decays.
    decay = float(np.exp(-h))
    both = _decaying(decay, kicks.sum(axis=1))
    kicks[1:, 0] += decay * h * both[:-1]
    x = _decaying(decay, kicks[:, 0])
    return x + np.sqrt(3) * (both - x)


@lru_cache(maxsize=64)  # quadrature takes longer than the wind of a short run, and all runs have the same step
def _covariance_root(h: float) -> np.ndarray:
    """Return the Cholesky factor, (2, 2), of the covariance of the state of `_across` after a step.

    The state (x, dx) of dx' = -x - 2 dx + noise answers a unit impulse with e^-s (s, 1 - s). Its covariance is the
    integral of that with itself over the step, by quadrature: rounding would ruin a difference of large numbers.
    """
    nodes, weights = np.polynomial.legendre.leggauss(40)
    s = h * (nodes + 1) / 2
    impulse = np.exp(-s) * np.stack([s, 1 - s])
    return np.linalg.cholesky(h / 2 * (impulse * weights) @ impulse.T)


def _decaying(keep: float, kicks: np.ndarray) -> np.ndarray:
    """Return x with x_k = keep x_(k-1) + kicks_k, (n,), by sums over 1, 2, 4, ... steps, each of whole arrays."""
    x, shift = kicks.copy(), 1
    while shift < len(x) and keep > 0:
        x[shift:] += keep * x[:-shift]
        keep, shift = keep * keep, 2 * shift
    return x


def _numbers(name: str, value: Sequence[float] | np.ndarray, count: int = -1, least: float = -np.inf) -> np.ndarray:
    """Return `count` finite numbers (-1 for any number but none), each at least `least`, or raise InputError."""
    array = finite_array(name, value, (count,))
    if not len(array) or (array < least).any():
        raise InputError(f"{name} must be numbers{f' >= {least:g}' * bool(np.isfinite(least))}, got {shown(value)}")
    return array
