"""`align`: the offset and the rate between the clocks of cable lengths and of poses, from cable speeds alone.

The lengths along the poses, by the robot's file, change as the readings do, whatever the offsets of the readings, their
units and signs, and the order of the cables. The correlation of all pairs of speeds finds the offset to a sample. Then
offset and rate are fitted to the lengths, and with them for each cable a scale, an offset and a linear effect of the
pose, which is what wrong anchors do.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.text import quantity
from .pose_track import on_spline, slopes_of_spline

MOST_BINS = 65_536  # of the coarse search
MOST_FITTED = 5000  # samples
LEAST_SHARED = 0.2  # of the shorter record
MOST_LEFT = 0.3  # of the changes of the lengths, that the poses do not explain
AS_GIVEN = 0.5  # of what another order gains
PEAKS, NEAR = 12, 5  # lags that are tried, and so many beside each are not
COARSER, SURE, LONGEST_STEP = (4, 16), 0.9, 0.5  # times the finest step, the correlation that suffices, [s]
STEPS = 20
Signals = Callable[[np.ndarray, np.ndarray, float], np.ndarray]
LARGEST_DRIFT, USUAL_DRIFT = 0.01, 1e-4
JUMP, MOST_JUMPS = 5.0, 4  # usual steps, from which on a gap may be a jump of the clock, and how many are looked at
NO_JUMP = 0.5  # of what poses leave unexplained: less is left once a jump is taken out
CORRELATED = 5.0  # factor of errors of a model over errors due to noise of the same size


class ClockJumpError(InputError):
    """A clock that was set while it recorded."""


class Records(NamedTuple):
    """Readings of N samples, and K poses with the lengths along them by the robot's file, each on a clock."""

    times: np.ndarray  # (N,) [s]
    readings: np.ndarray  # (N, m), in any unit
    pose_times: np.ndarray  # (K,) [s]
    lengths: np.ndarray  # (K, m) [m]
    poses: np.ndarray  # (K, d), what the effect of wrong anchors is linear in


class Clock(NamedTuple):
    """Time of the poses = offset + rate * time of the lengths [s], the correlation of speeds, up to 1, and sigmas."""

    offset: float
    rate: float
    likeness: float
    sigma: float

    def __str__(self) -> str:
        ppm = 1e6 * (self.rate - 1)
        drift = f", {quantity(abs(ppm), 'ppm', 3)} {'fast' if ppm > 0 else 'slow'}" if ppm else ""
        ahead = "ahead" if self.offset >= 0 else "behind"
        return f"the clock of the poses is {abs(self.offset):.6f} s {ahead}{drift}"


def align(records: Records) -> Clock:
    """Return the clock of poses relative to that of readings; raise InputError if speeds have too little in common."""
    clock, left = _aligned(records)
    if left > MOST_LEFT:
        share = quantity(100 * left, "%", 2)
        raise InputError(f"lengths and poses must be of one motion, got poses that leave {share} of it unexplained")
    return clock


def check_jumps(records: Records) -> None:
    """Raise InputError if a gap in one of the clocks must be a jump, because the motion went on without it."""
    left = np.inf
    for which, field in (("lengths", "times"), ("poses", "pose_times")):
        own = getattr(records, field)
        steps = np.diff(own)
        usual = float(np.median(steps))
        wide = np.flatnonzero(steps > JUMP * usual)
        for k in wide[np.argsort(-steps[wide])[:MOST_JUMPS]]:
            if left == np.inf:
                left = _aligned(records)[1]
            jump = float(steps[k]) - usual
            closed = np.where(np.arange(len(own)) > k, own - jump, own)
            if _aligned(records._replace(**{field: closed}))[1] < NO_JUMP * left:
                raise ClockJumpError(
                    f"times of the {which} must be of one clock, got one that seems to jump by "
                    f"{quantity(jump, 's', digits=3)} at {own[k]:.3f} s; cut the log there"
                )


def _aligned(records: Records) -> tuple[Clock, float]:
    """Return the clock, and the part of the lengths' changes that the poses leave unexplained."""
    times, readings, pose_times, lengths, poses = records
    found = [coarse(times, readings, pose_times, lengths)]
    if found[0][2] < SURE:  # poses in another frame still show how fast the platform is
        offset, _, likeness = coarse(times, readings, pose_times, poses[:, :3], _whole_speed)
        found.append((offset, np.arange(lengths.shape[1]), likeness))
    fitted = [
        (*_fine(records._replace(readings=readings[:, order]), offset), likeness) for offset, order, likeness in found
    ]
    clock, left, likeness = min(fitted, key=lambda one: one[1])
    return clock._replace(likeness=likeness), left


def coarse(
    times: np.ndarray, readings: np.ndarray, pose_times: np.ndarray, lengths: np.ndarray, signals: Signals | None = None
) -> tuple[float, np.ndarray, float]:
    """Return the offset [s], the column of the readings that each cable resembles, and the correlation.

    Speeds over longer times, which have less noise, are tried as well.
    """
    signals = signals or _speeds
    finest = max(*(float(np.median(np.diff(one))) for one in (times, pose_times)), 0.0)
    found = [_correlated(times, readings, pose_times, lengths, signals, finest)]
    for coarser in COARSER:
        if found[-1][2] < SURE and coarser * finest < LONGEST_STEP:
            found.append(_correlated(times, readings, pose_times, lengths, signals, coarser * finest))
    return max(found, key=lambda one: one[2])


def _correlated(
    times: np.ndarray, readings: np.ndarray, pose_times: np.ndarray, lengths: np.ndarray, signals: Signals, apart: float
) -> tuple[float, np.ndarray, float]:
    from scipy.optimize import linear_sum_assignment

    spans = np.ptp(times), np.ptp(pose_times)
    dt = max(apart, max(spans) / MOST_BINS)
    a, b = (signals(of, values, dt) for of, values in ((pose_times, lengths), (times, readings)))
    size = 1 << int(np.ceil(np.log2(a.shape[1] + b.shape[1])))
    lags = np.arange(-b.shape[1] + 1, a.shape[1])
    first, second = np.fft.rfft(a, size), np.conj(np.fft.rfft(b, size))
    as_given, any_order = np.zeros(len(lags)), np.zeros(len(lags))
    for i, spectrum in enumerate(first):
        pairs = np.fft.irfft(spectrum * second, size)[:, lags]
        as_given += pairs[i]
        any_order += np.abs(pairs).max(axis=0)
    # The energy of both where they overlap at each lag.
    energy_a, energy_b = (np.concatenate([[0.0], np.cumsum((one**2).sum(axis=0))]) for one in (a, b))
    begin, end = np.maximum(lags, 0), np.minimum(lags + b.shape[1], a.shape[1])
    energies = np.sqrt((energy_a[end] - energy_a[begin]) * (energy_b[end - lags] - energy_b[begin - lags]))
    shared = (end - begin) / min(a.shape[1], b.shape[1])
    enough = (shared >= LEAST_SHARED) & (energies > 0.01 * energies.max(initial=0.0))
    tried: list[tuple[float, int, np.ndarray, float]] = []
    for number, alike in enumerate((as_given, any_order)):
        alike = np.where(enough, alike / np.maximum(energies, 1e-300), 0.0)
        score = _gain(alike, shared)
        for _ in range(1 if number == 0 else PEAKS):
            place = int(np.argmax(score))
            order, likeness = np.arange(len(a)), float(alike[place])
            if number:
                lag = lags[place]
                pairs = np.abs(a[:, begin[place] : end[place]] @ b[:, begin[place] - lag : end[place] - lag].T)
                order = linear_sum_assignment(-pairs)[1]
                likeness = float(np.trace(pairs[:, order]) / max(energies[place], 1e-300))
            tried.append((float(_gain(likeness, shared[place])), place, order, likeness))
            score[max(place - NEAR, 0) : place + NEAR + 1] = -np.inf
    # A symmetric robot looks like itself in another order at another time: the given order comes first.
    best = max(tried, key=lambda one: one[0])
    _, place, order, likeness = tried[0] if tried[0][0] > AS_GIVEN * best[0] else best
    return float(pose_times[0] - times[0] + lags[place] * dt), order, likeness


def _gain(likeness: Any, shared: Any) -> Any:
    """Return the gain of the log-likelihood by a correlation, for records that share more or less time."""
    return -shared * np.log1p(-(np.clip(likeness, -0.99999, 0.99999) ** 2))


def _rates(times: np.ndarray, values: np.ndarray, apart: float) -> tuple[np.ndarray, np.ndarray]:
    """Return equal times (n + 1,), and the changes between them of values (N, m), (m, n)."""
    grid = times[0] + apart * np.arange(max(int(np.ptp(times) / apart), 2))
    return grid, np.array([np.diff(np.interp(grid, times, column)) for column in values.T])


def _whole_speed(times: np.ndarray, values: np.ndarray, apart: float) -> np.ndarray:
    """Return the size of all speeds together, as `_speeds`, (1, n)."""
    grid, rates = _rates(times, values, apart)
    whole = np.cumsum(np.sqrt((rates**2).sum(axis=0)))
    return _speeds(grid[1:], whole[:, None], apart)


def _speeds(times: np.ndarray, values: np.ndarray, apart: float) -> np.ndarray:
    """Return the speeds (m, n) of values (N, m) at equal times, each of mean 0 and of one size."""
    rates = _rates(times, values, apart)[1]
    rates -= rates.mean(axis=1, keepdims=True)
    limit = 10 * np.median(np.abs(rates), axis=1, keepdims=True) + 3 * rates.std(axis=1, keepdims=True)
    rates = np.clip(rates, -limit, limit)  # readings that are wrong
    return rates / np.maximum(np.sqrt((rates**2).mean(axis=1, keepdims=True)), 1e-300)


def _fine(records: Records, offset: float) -> tuple[Clock, float]:
    """Fit offset and rate by the Gauss-Newton method, and return the unexplained part of the lengths' changes, up to 1.

    Scales, offsets and linear effects are eliminated.
    """
    times, readings, pose_times, lengths, poses = records
    low, high = pose_times[0] - offset, pose_times[-1] - offset
    rows = np.flatnonzero((times >= low) & (times <= high))
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_FITTED)).astype(int))]
    t, y = times[rows], readings[rows].T
    middle, half = 0.5 * (t[0] + t[-1]), max(0.5 * float(np.ptp(t)), 1e-9)
    curve = np.hstack([lengths, poses])
    slopes_of_curve = slopes_of_spline(pose_times, curve)
    m, shift, drift, left = len(y), 0.0, 0.0, 1.0
    sigma = np.full(2, np.inf)
    for _ in range(STEPS):
        at = np.clip(offset + shift + t + drift * (t - middle), pose_times[0], pose_times[-1])
        values, slopes = on_spline(pose_times, curve, slopes_of_curve, at)
        normal, right, rest, count = np.zeros((2, 2)), np.zeros(2), 0.0, 0
        sizes = np.empty(m)
        for i in range(m):
            F = np.column_stack([np.ones(len(t)), values[:, i], values[:, m:]])
            Q, R = np.linalg.qr(F)
            by_columns = np.linalg.lstsq(R, Q.T @ y[i], rcond=1e-9)[0]
            slope = slopes[:, [i, *range(m, slopes.shape[1])]] @ by_columns[1:]
            D = np.column_stack([slope, slope * (t - middle) / half])
            D, e = D - Q @ (Q.T @ D), y[i] - F @ by_columns
            size = max(1.4826 * float(np.median(np.abs(e))), 1e-12)
            sizes[i] = size / max(float(y[i].std()), 1e-12)
            weight = np.minimum(1.0, 3 * size / np.maximum(np.abs(e), 1e-300)) / size**2  # Huber's
            normal += D.T @ (weight[:, None] * D)
            right += D.T @ (weight * e)
            rest, count = rest + float((weight * e**2).sum()), count + len(t)
        left = float(sizes.mean())
        rests = rest / count  # errors of the model are alike from sample to sample
        normal[1, 1] += CORRELATED**2 * rests / (USUAL_DRIFT * half) ** 2
        right[1] -= CORRELATED**2 * rests * drift * half / (USUAL_DRIFT * half) ** 2
        if np.linalg.cond(normal) > 1e12:
            break
        step = np.linalg.solve(normal, right)
        sigma = CORRELATED * np.sqrt(rests * np.diag(np.linalg.inv(normal)))
        step *= min(1.0, 0.2 / max(float(np.abs(step).max()), 1e-300))
        shift, drift = shift + step[0], float(np.clip(drift + step[1] / half, -LARGEST_DRIFT, LARGEST_DRIFT))
        if np.abs(step).max() < 1e-7:
            break
    if abs(drift) * half < 3 * sigma[1]:
        drift = 0.0
    return Clock(float(offset + shift - drift * middle), 1 + float(drift), 0.0, float(sigma[0])), left
