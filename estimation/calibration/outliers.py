"""Outliers and slipped winches, by statistical tests of the residuals (data snooping).

With unknown poses an error of one reading spreads over the residuals of its sample. The fraction that stays in its own
residual is the redundancy r of the reading, between 0 and 1. The residual divided by sigma sqrt(r) is normally
distributed, and the largest of a sample marks the outlier (Baarda). A slip changes the offset of a cable from one
sample on. Cumulative sums test this additional parameter for every cable and sample at once.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...models import points
from ..logs.measurements import ARRAYS, changed
from ..pose.wrong_lengths import TOLD_APART
from .fit import fit, held
from .geometry import length_of
from .model import Model, State
from .normal_equations import NormalEquations, metric
from .parameters import Parameters
from .products import quadratic_forms
from .projection import Projected, parts, project

LEVEL = 0.005  # of both tests, for all readings together, and share of sound ones among several outliers
LEAST_THRESHOLD = 5.0  # sigmas; errors have longer tails than the normal distribution
SMALLEST_REDUNDANCY = 0.02  # a reading with less hardly shows its own errors
SHORTEST = 5  # samples on each side of a slip
CLEAR = 3.0  # a slip is at least this many times the other residuals of its cable
MOST_LEVERAGED = 5000  # samples; of more, each has little influence on the parameters
NEARLY = 0.3  # of the clearest slip's statistic, of another cable's that may be the true one
MOST_CANDIDATES = 3
WINDOW = 25  # samples on each side, over which a slip must be visible as a step
VISIBLE = 0.5  # share of it that must be
UNBALANCED = 1 - 1e-7  # share of sound samples whose forces are in better balance than those that are left out
NEAR_LIMIT = 0.25  # of the largest residual: range below it in which the density of residuals is counted
MOST_LOST = 0.5  # largest reduction of E psi'
FORCES_BY_CHANCE = 0.1  # by which the noise of forces may differ from the stated one


class Outlier(NamedTuple):
    """An outlier: cable and sample, from 0, and its error [m].

    With an unknown pose it is the most likely one, and `others` are the cables that may be wrong instead of it.
    """

    cable: int
    sample: int
    error: float
    others: tuple[int, ...] = ()


class Slip(NamedTuple):
    """A slipped winch: cable and first sample after the slip, from 0; the cable's offset changes by `size` [m]."""

    cable: int
    sample: int
    size: float
    sigma: float


def _threshold(count: int) -> float:
    from scipy.special import ndtri

    return max(LEAST_THRESHOLD, float(-ndtri(LEVEL / max(count, 1))))


def _limit(sizes: np.ndarray, count: int, known: int) -> float:
    """Return the size above which the largest error of a sample is no noise, in standard deviations.

    The first outlier must be beyond `_threshold`. Where there are some, errors are not rare, and the limit is lower, so
    that only the share `LEVEL` of all outliers is expected to be sound readings (Benjamini and Hochberg).

    - `sizes`: Largest of each sample, (N,), of `count` readings.
    - `known`: Number of outliers that are already left out.
    """
    from scipy.special import ndtri

    first, ranked = _threshold(count), -np.sort(-sizes)
    if not known and ranked[0] <= first:
        return first
    limits = -ndtri(LEVEL * (known + 1 + np.arange(len(ranked))) / (known + count))
    beyond = np.flatnonzero(ranked > limits)
    return float(limits[beyond[-1]]) if beyond.size else first


def by_left_out(model: Model, state: State) -> float:
    """Return the factor by which leaving out readings that disagree increases the variances of parameters.

    An M-estimator has the variance E psi^2 / (E psi')^2 with psi(e) = e up to a limit c and 0 beyond, for which E psi'
    is smaller by c times the density of errors at +-c. A sample that is left out in part loses one redundant equation.
    """
    if model.weights.all():
        return 1.0
    size, redundancy, _ = _sizes(model, state)
    near = np.sum(size.max(axis=0) > (1 - NEAR_LIMIT) * size.max()) if size.any() else 0
    return float((1 - min(near / NEAR_LIMIT / max(float(redundancy[size > 0].sum()), 1.0), MOST_LOST)) ** -2)


def find_unbalanced(model: Model, state: State) -> tuple[float, np.ndarray] | None:
    """Return by what factor errors of forces exceed those assumed, and the samples with far larger ones, (N,) of bool.

    None without redundant forces.
    """
    model = replace(model, unbalanced=None)
    forces = model.balanced
    if forces is None:
        return None
    equations = NormalEquations.at(model, state, metric(model))
    spare, squares = forces.equations.astype(float), np.zeros(len(state.shift))
    for rows, part, own in model.parts(state):
        balance = part.linearised(own)[1].balance
        assert balance is not None
        squares[rows] = (balance.residuals**2).sum(axis=1)
        if equations.inverse_root is not None and balance.by_pose is not None:
            K = balance.by_pose * part.poses_vary[:, None]
            spare[rows] -= ((K @ np.swapaxes(equations.inverse_root[rows], 1, 2)) ** 2).sum(axis=(1, 2))
    tested = model.inside(state) & (spare > SMALLEST_REDUNDANCY)
    if not tested.any():
        return None
    from scipy.special import gammaincinv

    usual, most = (2 * gammaincinv(np.maximum(spare, SMALLEST_REDUNDANCY) / 2, share) for share in (0.5, UNBALANCED))
    noise = float(np.median(squares[tested] / usual[tested]))
    certain = FORCES_BY_CHANCE + 3 / np.sqrt(2 * float(spare[tested].sum()))
    factor = np.sqrt(noise) if abs(np.log(max(noise, 1e-12))) > certain else 1.0
    return float(factor), tested & (squares > max(noise, 1e-12) * most)


def _sizes(model: Model, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return sizes of residuals in standard deviations, 0 where unseen, redundancies and residuals, (m, N) each."""
    found = project(model, state)
    if len(state.shift) <= MOST_LEVERAGED and model.parameters.varies.any():
        # Parameters, too, adapt to a wrong reading.
        inverse = _inverse(model, state, found.equations, length_of(model.robot))
        for part in parts(model, state, found.equations):
            for i in range(model.robot.m):
                rows, columns = part.without_poses(i)
                found.redundancy[i, part.rows] -= quadratic_forms(rows, inverse[np.ix_(columns, columns)])
    seen, size = found.redundancy > SMALLEST_REDUNDANCY, np.zeros_like(found.residuals)
    size[seen] = np.abs(found.residuals[seen]) / np.sqrt(found.redundancy[seen])
    return size, found.redundancy, found.residuals


def find_outliers(model: Model, state: State) -> tuple[list[Outlier], np.ndarray]:
    """Return outliers, at most one per sample, and the readings to leave out because of them, (m, N) of bool."""
    size, redundancy, residuals = _sizes(model, state)
    seen, left = size > 0, np.zeros(size.shape, dtype=bool)
    if not seen.any():
        return [], left
    worst = np.argmax(size, axis=0)
    samples = np.arange(size.shape[1])
    known = int((~model.weights).any(axis=0).sum())
    noise = max(1.0, 1.4826 * float(np.median(size[seen])))
    limit = noise * _limit(size[worst, samples] / noise, int(seen.sum()), known)
    # The smaller half may only be the echo of the larger in other samples, through the parameters.
    wrong = samples[size[worst, samples] > max(limit, 0.5 * float(size.max()))]
    if np.isinf(model.pose_sigmas[wrong]).any():
        return [_attributed(model, state, int(k), left[:, k]) for k in wrong], left
    sigma = model.measurements.sigma.lengths
    left[worst[wrong], wrong] = True
    return [
        Outlier(int(i), int(k), float(-sigma * residuals[i, k] / redundancy[i, k]))
        for i, k in zip(worst[wrong], wrong, strict=True)
    ], left


def _attributed(model: Model, state: State, sample: int, left: np.ndarray) -> Outlier:
    """Return the wrong reading of a sample, and mark the readings to leave out in `left`, (m,) of bool.

    It is the one whose removal gives the best fit: a large error moves an unknown pose so far that the residuals do not
    show which reading is wrong. Others may explain the sample nearly as well. A wrong choice would leave an error that
    is too small to be seen, so these are left out too, and the whole sample if the rest does not predict them.
    """
    m, parameters = model.robot.m, Parameters(model.robot, ())
    scales = parameters.table(state.x)[:, 7]
    lengths = model.measurements.lengths[sample] + model.slips(state.x)[:, sample] / scales
    position, rotation = model.poses(state)
    pose = np.concatenate([position[sample], points.angles(rotation[sample])])
    given, copied = model.measurements, np.full(m, sample)
    of_sample = {name: getattr(given, name) for name in ARRAYS}
    of_sample = {name: None if of is None else of[copied] for name, of in of_sample.items()}
    copies = changed(given, **of_sample | {"lengths": np.tile(lengths, (m, 1)), "times": None})
    used = np.tile(model.weights[:, sample, None], (1, m))
    felt = model.felt and model.felt.only(copied)
    without = Model(parameters, copies, {}, used & ~np.eye(m, dtype=bool), np.tile(pose, (m, 1)), felt=felt)
    begin = without.begin()._replace(x=state.x[: parameters.count].copy())
    found = fit(without, begin, 1.0).state
    of = without.residuals(found)
    costs = of.of_samples - (of.balance**2).sum(axis=1)  # forces are far less certain in motion
    costs[~np.isfinite(costs) | ~used[:, 0]] = np.inf
    cable = int(np.argmin(costs))
    residuals, derivatives = replace(without, weights=np.ones((m, m), dtype=bool)).linearised(found)
    left[:] = costs <= costs[cable] + TOLD_APART**2
    others = np.flatnonzero(left & (np.arange(m) != cable))
    rest = NormalEquations.at(replace(without, weights=used & ~left[:, None]), found, metric(without))
    if others.size and rest.inverse_root is not None:
        by_pose = (derivatives.poses[left, cable] * without.poses_vary[cable]) @ rest.inverse_root[cable].T
        left |= 1 / (1 + (by_pose**2).sum(axis=1).max()) < SMALLEST_REDUNDANCY
    error = float(-model.measurements.sigma.lengths * residuals.readings[cable, cable])
    return Outlier(cable, sample, error, tuple(others.tolist()))


def find_slips(model: Model, state: State, length: float) -> list[Slip]:
    """Return the clearest slip of a winch, and with unknown poses others nearly as clear, which only a fit can exclude.

    Unknown poses spread a slip over the residuals of all cables.
    """
    found = project(model, state)
    m, count = found.residuals.shape
    if count < 4 * SHORTEST:
        return []
    seen = found.redundancy > SMALLEST_REDUNDANCY
    if not seen.any():
        return []
    spread = 1.4826 * float(np.median(np.abs(found.residuals[seen] / np.sqrt(found.redundancy[seen]))))
    limit = _threshold(m * count) * max(1.0, spread)
    candidates: list[tuple[float, int, int, float, float]] = []
    for i, absorbed in enumerate(_absorbed(model, state, found.equations, length)):
        total = np.cumsum(found.redundancy[i, ::-1])[::-1]
        information = np.maximum(total - absorbed, 1e-9 * max(float(total[0]), 1e-9))
        sums = np.cumsum(found.residuals[i, ::-1])[::-1]
        statistic = sums**2 / information
        statistic[:SHORTEST] = statistic[-SHORTEST + 1 :] = 0.0
        statistic[information < SMALLEST_REDUNDANCY * SHORTEST] = 0.0
        k = int(np.argmax(statistic))
        candidates.append((float(statistic[k]), i, k, float(sums[k] / information[k]), float(information[k] ** -0.5)))
    unit = model.measurements.sigma.lengths
    # A wrong reading disturbs a cable's parameters, and so all its residuals: the clearest may be no step.
    slips: list[Slip] = []
    most = MOST_CANDIDATES if np.isinf(model.pose_sigmas).any() else 1
    for statistic, cable, sample, size, sigma in sorted(candidates, reverse=True):
        if statistic <= max(limit**2, NEARLY * max(candidates)[0] * bool(slips)) or len(slips) == most:
            break
        flat = found.residuals[cable].copy()
        for part in (slice(None, sample), slice(sample, None)):
            flat[part] -= flat[part].mean()
        if statistic > limit**2 * _correlation(flat) and _is_a_step(found, cable, sample, size):
            slips.append(Slip(cable, sample, unit * size, unit * sigma))
    return slips


def _inverse(model: Model, state: State, equations: NormalEquations | None, length: float) -> np.ndarray:
    """Return the inverse of the normal matrix, (p, p), with the weak prior of `held`."""
    whole = equations or NormalEquations.at(model, state, metric(model))
    return np.linalg.inv(held(whole.S, length))


def _absorbed(model: Model, state: State, equations: NormalEquations | None, length: float) -> np.ndarray:
    """Return the part of a step of each cable's residuals, from each sample on, that parameters absorb, (m, N)."""
    inverse = _inverse(model, state, equations, length)
    sums, result = np.zeros((model.robot.m, len(inverse))), np.empty(model.weights.shape)
    for part in parts(model, state, equations, backwards=True):
        for i, total in enumerate(sums):
            rows, columns = part.without_poses(i)
            rows[-1] += total[columns]
            np.cumsum(rows[::-1], axis=0, out=rows[::-1])  # of all samples from one on
            total[columns] = rows[0]
            result[i, part.rows] = quadratic_forms(rows, inverse[np.ix_(columns, columns)])
    return result


def _correlation(residuals: np.ndarray) -> float:
    """Return the correlation length of residuals (N,) in samples: 1 + 2 times the sum of autocorrelations."""
    count = len(residuals)
    lagged = np.fft.irfft(np.abs(np.fft.rfft(residuals, 2 * count)) ** 2)[: count // 4 + 1]
    if not lagged[0] > 0:
        return 1.0
    lags = lagged[1:] / lagged[0]
    ends = np.flatnonzero(lags < 2 / np.sqrt(count))
    return 1.0 + 2.0 * float(lags[: ends[0] if ends.size else len(lags)].sum())


def _is_a_step(found: Projected, cable: int, sample: int, size: float) -> bool:
    """Return whether residuals change at the sample by a large part of `size`, compared with their scatter."""
    window = slice(max(sample - WINDOW, 0), sample), slice(sample, sample + WINDOW)
    before, after = (np.median(found.residuals[cable, part]) for part in window)
    kept = float(np.median(found.redundancy[cable, max(sample - WINDOW, 0) : sample + WINDOW]))
    around = np.concatenate([found.residuals[cable, window[0]] - before, found.residuals[cable, window[1]] - after])
    scatter = 1.4826 * float(np.median(np.abs(around)))
    step = (after - before) / max(kept, SMALLEST_REDUNDANCY)
    return bool(step * size > VISIBLE * size**2 and abs(step) * np.sqrt(max(kept, 0.0)) > CLEAR * min(scatter, 1e9))
