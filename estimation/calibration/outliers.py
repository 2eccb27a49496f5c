"""Outliers and slipped winches, by a robust fit and statistical tests of its residuals.

With unknown poses an error of one reading spreads over the residuals of its sample. The fraction that stays in its own
residual is the redundancy r of the reading, between 0 and 1. The residual divided by sigma sqrt(r) is normally
distributed (Baarda). A slip changes the offset of a cable from one sample on. Cumulative sums test this additional
parameter for every cable and sample at once.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...models import points
from ..logs.measurements import ARRAYS, Measurements
from ..pose.estimate import FALSE_ALARM_IN_LOG, largest_cost
from ..pose.wrong_lengths import TOLD_APART
from .fit import fit, held, settled
from .model import Model, State
from .normal_equations import NormalEquations, metric, pose_equations
from .parameters import Parameters
from .products import quadratic_forms
from .projection import Projected, parts, project
from .representative import of_motion

LEVEL = 0.005  # share of sound readings among several outliers
LEAST_THRESHOLD = 5.0  # sigmas; errors have longer tails than the normal distribution
SMALLEST_REDUNDANCY = 0.02  # a reading with less hardly shows its own errors
SHORTEST = 5  # samples on each side of a slip
CLEAR = 3.0  # a slip is at least this many times the other residuals of its cable
NEARLY = 0.3  # of the clearest slip's statistic, of another cable's that may be the true one
MOST_CANDIDATES = 6
WINDOW = 25  # samples on each side, over which a slip must be visible as a step
VISIBLE = 0.5  # share of it that must be
UNBALANCED = 1 - 1e-7  # share of sound samples whose forces are in better balance than those that are left out
MOST_SAMPLES = 20_000  # of a robust fit with known poses
SETTLED = 0.1  # decrease of the squares of a sample, in variances, that its known pose need not take
SOFT = 4.0  # sigmas at which a reading has a quarter of its weight
SOFTER = 4.0  # factor of the square of this limit from one step to the next
STEPS, ENOUGH = 3, 1e-2  # of the fit at each limit, and share of the sum of squares of a step that it need not take
SOUND, SMALLER = 0.25, 0.3186  # share of the smallest errors, which are sound for certain, and their limit [sigmas]
FALLS = 0.8  # times the last limit, by which it falls at least
DOUBTFUL = 0.02  # share of sound samples that fit worse than the rest of one with a wrong reading may
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


def wrong_shares(outliers: Sequence[Outlier], measurements: Measurements) -> np.ndarray:
    """Return the share of the readings of each cable that are outliers, (m,); a rest counts once."""
    wrong = np.zeros(measurements.lengths.shape, dtype=bool)
    wrong[[one.sample for one in outliers], [one.cable for one in outliers]] = True
    return np.asarray(wrong[of_motion(measurements)].mean(axis=0))


def _threshold(count: int) -> float:
    from scipy.special import ndtri

    return max(LEAST_THRESHOLD, float(-ndtri(FALSE_ALARM_IN_LOG / 2 / max(count, 1))))


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


def _noise(sizes: np.ndarray) -> float:
    """Return the standard deviation of sound errors from the sizes of all, (n,), in the stated one, at least 1."""
    return max(1.0, float(np.quantile(sizes, SOUND)) / SMALLER) if sizes.size else 1.0


def find_unbalanced(model: Model, state: State) -> tuple[float, np.ndarray] | None:
    """Return by what factor errors of forces exceed those assumed, and the samples with far larger ones, (N,) of bool.

    None without redundant forces.
    """
    model = replace(model, unbalanced=None)
    forces = model.balanced
    if forces is None:
        return None
    spare, squares = forces.equations.astype(float), np.zeros(len(state.shift))
    for rows, part, own in model.parts(state):
        residuals, derivatives = part.linearised(own)
        balance = derivatives.balance
        assert balance is not None
        squares[rows] = (balance.residuals**2).sum(axis=1)
        if model.poses_vary.any() and balance.by_pose is not None:
            K = balance.by_pose * part.poses_vary[:, None]
            inverse_root, _, _ = pose_equations(part, residuals, derivatives)
            spare[rows] -= ((K @ np.swapaxes(inverse_root, 1, 2)) ** 2).sum(axis=(1, 2))
    tested = model.inside(state) & (spare > SMALLEST_REDUNDANCY)
    if not tested.any():
        return None
    from scipy.special import gammaincinv

    usual, most = (2 * gammaincinv(np.maximum(spare, SMALLEST_REDUNDANCY) / 2, share) for share in (0.5, UNBALANCED))
    noise = float(np.median(squares[tested] / usual[tested]))
    certain = FORCES_BY_CHANCE + 3 / np.sqrt(2 * float(spare[tested].sum()))
    factor = np.sqrt(noise) if abs(np.log(max(noise, 1e-12))) > certain else 1.0
    return float(factor), tested & (squares > max(noise, 1e-12) * most)


def robust(model: Model, state: State, length: float, rough: float = np.inf) -> tuple[State, np.ndarray]:
    """Return the state that fits most readings, whatever the others are, and which readings fit there, (m, N) of bool.

    Readings have the weights of Geman and McClure, with a limit that falls step by step from one beyond all residuals:
    each minimum is near the one before (graduated non-convexity, Yang et al. 2020). Plain least squares would move
    unknown poses and parameters towards wrong readings, until sound ones look wrong.

    With known poses, the parameters are fitted to some samples of a long log, and to few of each rest: otherwise cables
    that are slack before and after the motion would count as most readings. All readings are compared with this fit.

    - `rough`: first limit, in the final ones, if the state is good enough for it.
    """
    rows = of_motion(model.measurements)
    if model.size_is_open or len(rows) == len(model.measurements) <= MOST_SAMPLES:
        return _robust(model, state, length, rough)[:2]
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), MOST_SAMPLES)).astype(int)]
    part = model.only(rows)
    found, _, least = _robust(part, fit(part, state.only(rows), length).state, length, rough)
    at = state._replace(x=found.x)
    at = settled(model, at, SETTLED) if model.poses_vary.any() else at
    left = project(model, at)
    sizes, limit = np.abs(left.residuals) / np.sqrt(np.maximum(left.redundancy, SMALLEST_REDUNDANCY)), np.sqrt(least)
    clean = sizes.max() <= limit / SOFT * _threshold(sizes.size)
    return (state, model.weights) if clean else (at, model.weights & (sizes <= limit))


def _robust(model: Model, state: State, length: float, rough: float) -> tuple[State, np.ndarray, float]:
    """Return what `robust` does, and the square up to which readings fit."""
    passes, exact = list[tuple[float, State, np.ndarray, float]](), not model.poses_vary.any()  # poses absorb no errors
    for follows in (False, True):  # the noise that residuals show, or the stated one
        begin, last = state, np.inf
        while True:
            found = project(model, begin)
            squares = found.residuals**2 / np.maximum(found.redundancy, SMALLEST_REDUNDANCY)
            noise = _noise(np.sqrt(squares[model.weights])) if follows or exact else 1.0
            if squares.max() <= ((noise if exact else 1.0) * _threshold(squares.size)) ** 2:
                return begin, model.weights, (SOFT * noise) ** 2
            least = (SOFT * (noise if follows else 1.0)) ** 2
            limit = max(least, min(last / SOFTER, rough * SOFT**2, float(squares.max())))
            if not limit < FALLS * last:  # also if residuals are infinite or undefined
                break
            soft = replace(model, weights=model.weights * (limit / (limit + squares)))
            begin, last = fit(soft, begin, length, STEPS, enough=ENOUGH).state, limit
        fits = model.weights & (squares <= least)
        passes.append((_unlikeliness(model, found.residuals**2, squares, fits), begin, fits, least))
    return min(passes, key=lambda one: one[0])[1:]


def _unlikeliness(model: Model, residuals: np.ndarray, squares: np.ndarray, fits: np.ndarray) -> float:
    """Return twice the negative log-likelihood of sound readings with one noise, and wrong ones of any size.

    Larger noise, or a wrong model, may leave few readings that fit the stated noise, and these by chance.

    - `residuals`, `squares`: squared residuals, and over their redundancies; `fits`: which readings are sound, (m, N).
    """
    unknown, wrong = np.isinf(model.pose_sigmas).sum(axis=1), model.weights & ~fits
    whole, left = (np.maximum(of.sum(axis=0) - unknown, 0) for of in (model.weights, fits))
    noise = max(1.0, float(residuals[fits].sum()) / max(int(left.sum()), 1))
    sound = float(residuals[fits].sum()) / noise + float(left.sum()) * np.log(noise)
    if not wrong.any():
        return sound
    lost = whole - left
    share = float(np.minimum(wrong.sum(axis=0), lost).sum()) / model.weights.sum()
    spread = -share * np.log(max(share, 1e-9)) - (1 - share) * np.log(max(1 - share, 1e-9))
    return sound + float(lost.sum()) * (1 + float(np.log(squares[wrong]).mean())) + 2 * model.weights.sum() * spread


def find_outliers(model: Model, state: State) -> tuple[list[Outlier], np.ndarray]:
    """Return outliers, and the readings to leave out because of them, (m, N) of bool."""
    found = project(model, state)
    seen, redundancy = found.redundancy > SMALLEST_REDUNDANCY, np.maximum(found.redundancy, SMALLEST_REDUNDANCY)
    size = np.where(seen, np.abs(found.residuals) / np.sqrt(redundancy), 0.0)  # in standard deviations
    noise, known = _noise(size[seen]), int((~model.weights).any(axis=0).sum())
    limit = noise * _limit(size.max(axis=0) / noise, int(seen.sum()), known)
    left = size > limit
    wrong = np.flatnonzero(left.any(axis=0))
    if model.poses_vary[wrong].any():
        return _attributed(model, state, wrong, limit, noise)
    errors = -model.measurements.sigma.lengths * found.residuals / redundancy
    return [Outlier(int(i), int(k), float(errors[i, k])) for i, k in zip(*left.nonzero(), strict=True)], left


def _attributed(
    model: Model, state: State, wrong: np.ndarray, limit: float, noise: float
) -> tuple[list[Outlier], np.ndarray]:
    """Return the wrong readings of samples (k,), and the readings to leave out because of them, (m, N) of bool.

    They are those whose removal, one by one, gives the best fit: a large error moves an unknown pose so far that the
    residuals do not show which reading is wrong. Where others explain a sample nearly as well, all of it is left out: a
    wrong choice would leave an error that is too small to be seen.
    """
    m, outliers = model.robot.m, list[Outlier]()
    used, chosen = model.weights[:, wrong].T.copy(), [list[tuple[int, float]]() for _ in wrong]
    others: dict[int, np.ndarray] = {}
    further, rows = False, np.arange(len(wrong))  # of the samples in which a further reading is wrong
    while rows.size:
        weights = (used[rows, None] & ~np.eye(m + 1, m, dtype=bool)).reshape(-1, m).T
        without = _copies(model, state, np.repeat(wrong[rows], m + 1), weights)
        found = fit(without, without.begin()._replace(x=state.x[: without.parameters.count].copy()), 1.0).state
        of = without.residuals(found)
        # Forces are far less certain in motion.
        costs = (of.of_samples - (of.balance**2).sum(axis=1)).reshape(-1, m + 1)
        with_all, costs = costs[:, m], costs[:, :m]
        costs[~np.isfinite(costs) | ~used[rows]] = np.inf
        every = replace(without, weights=np.ones_like(weights)).residuals(found).readings.T.reshape(-1, m + 1, m)
        better = with_all - costs.min(axis=1) > limit**2
        if further:  # of one wrong reading in a sample a second one is likely
            spare = np.maximum(used[rows].sum(axis=1) - np.isinf(model.pose_sigmas[wrong[rows]]).sum(axis=1), 1)
            better = with_all > noise**2 * np.array([largest_cost(int(one), DOUBTFUL) for one in spare])
        further = True
        rows, costs, every = rows[better], costs[better], every[better]
        if not rows.size:
            break
        cables, best = np.argmin(costs, axis=1), costs.min(axis=1)
        doubtful = costs <= best[:, None] + TOLD_APART**2
        for row, cable, errors in zip(rows, cables, every, strict=True):
            chosen[row].append((int(cable), float(-model.measurements.sigma.lengths * errors[cable, cable])))
        used[rows] &= ~doubtful
        several = doubtful.sum(axis=1) > 1
        used[rows[several]] = False
        others |= dict(zip(rows[several].tolist(), doubtful[several], strict=True))
        rows = rows[used[rows].any(axis=1)]
    left = np.zeros(model.weights.shape, dtype=bool)
    left[:, wrong] = model.weights[:, wrong] & ~used.T
    for row, cables in enumerate(chosen):
        also = set(np.flatnonzero(others.get(row, ())).tolist()) - {cable for cable, _ in cables}
        outliers += [Outlier(cable, int(wrong[row]), error, tuple(also)) for cable, error in cables]
    return outliers, left


def _copies(model: Model, state: State, samples: np.ndarray, weights: np.ndarray) -> Model:
    """Return the model of copies of samples (k,) with weights (m, k), which begins at the state without free values."""
    parameters, given = Parameters(model.robot, ()), model.measurements
    lengths = given.lengths + (model.slips(state.x) / parameters.table(state.x)[:, 7:8]).T
    position, rotation = model.poses(state)
    poses = np.hstack([position[samples], points.angles(rotation[samples])])
    of_samples = {name: getattr(given, name) for name in ARRAYS} | {"lengths": lengths, "times": None}
    if given.poses is not None:
        position, rotation = model.poses(model.begin()._replace(x=state.x))
        halves = np.hstack([position, points.angles(rotation)]).reshape(-1, 2, 3)  # positions, orientations
        seen = np.isfinite(model.pose_sigmas[:, :6]).reshape(-1, 2, 3).all(axis=2, keepdims=True)
        of_samples["poses"] = np.where(seen, halves, np.nan).reshape(-1, 6)
    copies = given.changed(**{name: None if of is None else of[samples] for name, of in of_samples.items()})
    felt = model.felt and model.felt.only(samples)
    return Model(parameters, copies, {}, weights, poses, felt=felt)


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
    for i, absorbed in enumerate(_absorbed(model, state, length)):
        total = np.cumsum(found.redundancy[i, ::-1])[::-1]
        information = np.maximum(total - absorbed, 1e-9 * max(float(total[0]), 1e-9))
        sums = np.cumsum(found.residuals[i, ::-1])[::-1]
        statistic = sums**2 / information
        statistic[:SHORTEST] = statistic[-SHORTEST + 1 :] = 0.0
        statistic[information < SMALLEST_REDUNDANCY * SHORTEST] = 0.0
        k = int(np.argmax(statistic))
        k += int(np.argmax(found.redundancy[i, k:] > SMALLEST_REDUNDANCY))  # the first sample that shows it
        candidates.append((float(statistic[k]), i, k, float(sums[k] / information[k]), float(information[k] ** -0.5)))
    unit = model.measurements.sigma.lengths
    # A wrong reading disturbs a cable's parameters, and so all its residuals: the clearest may be no step.
    slips: list[Slip] = []
    most = MOST_CANDIDATES if model.has_unknown_poses else 1
    for statistic, cable, sample, size, sigma in sorted(candidates, reverse=True):
        if statistic <= max(limit**2, NEARLY * max(candidates)[0] * bool(slips)) or len(slips) == most:
            break
        flat = found.residuals[cable].copy()
        for part in (slice(None, sample), slice(sample, None)):
            flat[part] -= flat[part].mean()
        if statistic > limit**2 * _correlation(flat) and _is_a_step(found, cable, sample, size):
            slips.append(Slip(cable, sample, unit * size, unit * sigma))
    return slips


def _absorbed(model: Model, state: State, length: float) -> np.ndarray:
    """Return the part of a step of each cable's residuals, from each sample on, that parameters absorb, (m, N)."""
    whole = NormalEquations.at(model, state, metric(model))
    inverse = np.linalg.inv(held(whole.S, length))
    sums, result = np.zeros((model.robot.m, len(inverse))), np.empty(model.weights.shape)
    for part in parts(model, state, whole, backwards=True):
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
