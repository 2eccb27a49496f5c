"""Choose further instants of an audit, where something may be exceeded between those that it has: `with_peaks`.

What limits bound, tensions and missing wrenches are known at instants. From one to the next each leaves the line by no
more than its curvature permits (`curvature`): where that is enough to exceed a limit, the instant in the middle is
looked at too, until it is decided. Where the motion's derivatives have corners or jumps, at the nodes of the program
and where phases meet, instants are on both sides.

A quantity that is smooth there leaves it by no more than an eighth of its second derivative times the square of the
time between. That is estimated from the instants around, twice as large as there, since it changes in between. Where a
quantity may jump between two instants, nothing is smooth: they are the sides of the jump, or not neighbours at all.
"""

from dataclasses import replace
from functools import reduce

import numpy as np

from ...solvers import solve_batch
from ..limits import Rate
from ..limits.distance import Distance
from ..tasks.scenario import MOST_SAMPLES, Scenario
from .checks import LENGTH_TOLERANCE
from .instants import Instants, instants, joined
from .tensions import tolerance_of

SAME = 1e-7  # of the whole time: nearer instants are the two sides of a jump
SAFETY = 2.0
BESIDE = 2e-9  # of the duration: how far before a jump
APART = 1e-4  # of the time between two instants: a corner that is nearer to one is as good as at it
PARTS = 4  # of the time between two instants, at a time: most of it that has to be halved has to be halved again
MOST_ROUNDS = 10  # of such parts
WIDE = 3  # instants to each side of a span, which its curvature needs
SINGULAR = 1e-12  # of the squares of all that the cables can change: what is so little counts as nothing
MOST_ROOM = 1e3  # of the weight: limits may be infinite
BLOCK = 8192  # instants whose matrices are in memory at once, besides those of all
UNDECIDED = 0.05  # of a tolerance: less than that beyond it is not looked for


def is_jump(times: np.ndarray) -> np.ndarray:
    """Return between which of the `times` (n,) of a whole motion a quantity may jump, (n - 1,)."""
    return np.diff(times) < SAME * (times[-1] - times[0])


def leaves(times: np.ndarray, values: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    """Return how far values (n, ...) leave the line between each two of `times` at most, (n - 1, ...)."""
    wide = (-1, *[1] * (values.ndim - 1))
    h = np.diff(times)
    slopes = np.diff(values, axis=0) / h.reshape(wide)
    bent = np.zeros_like(values)
    bent[1:-1] = np.abs(np.diff(slopes, axis=0)) / ((h[1:] + h[:-1]) / 2).reshape(wide)
    bent[1:-1][jumps[1:] | jumps[:-1]] = 0.0
    return between(times, bent)


def between(times: np.ndarray, bent: np.ndarray) -> np.ndarray:
    """Return how far what has second derivatives (n, ...) of that size leaves the line between two instants."""
    padded = np.concatenate([bent[:1], bent, bent[-1:]])
    most = np.maximum(np.maximum(padded[:-3], padded[1:-2]), np.maximum(padded[2:-1], padded[3:]))
    return SAFETY / 8 * most * (np.diff(times) ** 2).reshape(-1, *[1] * (bent.ndim - 1))


def law_jumps(scenario: Scenario) -> np.ndarray:
    """Return the times at which the acceleration along a path with a time law may jump, (k,) [s]."""
    paths = scenario.path, *scenario.carrier_paths.values()
    return np.unique(np.concatenate([path.jumps() for path in paths]))


def _corners(seen: Instants) -> np.ndarray:
    """Return the instants at corners of the motion, and just before its jumps, (k,).

    It jumps where its load or the acceleration of a time law may. Of laws there is an instant between two jumps too,
    and of pieces of a path that are as short as the time between a few instants there are as many inside.
    """
    scenario, nodes = seen.scenario, np.zeros(0) if seen.deviation is None else seen.deviation.nodes
    paths = scenario.path, *scenario.carrier_paths.values()
    step, duration = seen.times[1] - seen.times[0], float(seen.times[-1])
    laws = law_jumps(scenario)
    jumps = np.unique(np.concatenate([laws, scenario.phases.boundaries]))
    begin, end = np.concatenate([path.pieces(duration) for path in paths]).T
    short = end - begin < PARTS * step
    inside = np.linspace(begin[short], end[short], PARTS + 1).ravel()
    corners = np.unique(np.concatenate([nodes, jumps, (laws[1:] + laws[:-1]) / 2, inside]))
    corners = corners[np.abs(corners - np.round(corners / step) * step) > APART * step]
    corners = np.concatenate([corners, jumps - BESIDE * duration])
    return np.unique(corners[(corners > 0.0) & (corners < duration)])


def with_peaks(seen: Instants) -> Instants:
    """Return instants with all others that it takes to decide whether something is exceeded between them."""
    scenario, corners = seen.scenario, _corners(seen)
    if corners.size:
        seen = joined(seen, instants(scenario, seen.deviation, corners))
    jumps = is_jump(seen.times)
    spans = np.flatnonzero(_open(seen, jumps))
    near, further = seen, list[Instants]()
    for _ in range(MOST_ROUNDS):
        if not spans.size or sum(len(each.times) for each in further) > MOST_SAMPLES:
            break
        near, jumps, parted = _about(near, jumps, spans)
        inner = np.linspace(near.times[parted], near.times[parted + 1], PARTS, endpoint=False, axis=1)[:, 1:]
        further.append(instants(scenario, seen.deviation, inner.ravel()))
        near = joined(near, further[-1])
        jumps = np.insert(jumps, np.repeat(parted, PARTS - 1), False)
        spans = ((parted + (PARTS - 1) * np.arange(len(parted)))[:, None] + np.arange(PARTS)).ravel()
        undecided = _open(near, jumps)
        spans = spans[undecided[spans]]
    return joined(seen, reduce(joined, further)) if further else seen


def _about(seen: Instants, jumps: np.ndarray, spans: np.ndarray) -> tuple[Instants, np.ndarray, np.ndarray]:
    """Return the instants about some spans, between which of them nothing is smooth, and where the spans then are."""
    chosen = np.zeros(len(seen.times), bool)
    for shift in range(-WIDE, WIDE + 2):
        chosen[np.clip(spans + shift, 0, len(chosen) - 1)] = True
    rows = np.flatnonzero(chosen)
    apart = (np.diff(rows) > 1) | jumps[rows[:-1]]
    return seen.of(rows), apart, np.searchsorted(rows, spans)


def _open(seen: Instants, jumps: np.ndarray) -> np.ndarray:
    """Return between which instants something may be exceeded, (n - 1,), that is not exceeded at one of them."""
    scenario, times = seen.scenario, seen.times
    spans = np.zeros(len(times) - 1, bool)
    for limit, values in zip(scenario.limits, seen.values, strict=True):
        if not isinstance(limit, Rate | Distance):
            spans |= _may_exceed(times, values, jumps, limit.low, limit.high, limit.tolerance)
    if scenario.robot.fixed_lengths is not None:
        lengths = scenario.dynamics.cable_lengths(seen.motion.pose, seen.carriers.pose) - scenario.robot.fixed_lengths
        spans |= _may_exceed(times, lengths, jumps, 0.0, 0.0, LENGTH_TOLERANCE)
    if seen.few:
        low, high = scenario.bounds_at(times)
        for case in seen.cases:
            for beyond in (low - case.tensions, case.tensions - high):
                spans |= _may_exceed(times, beyond, jumps, -np.inf, 0.0, tolerance_of(scenario.robot))
        spans |= _may_exceed(times, seen.violation[:, None], jumps, -np.inf, 0.0, seen.tolerance)
    elif (seen.violation <= seen.tolerance).all():
        for case in seen.cases:
            spans |= _may_be_short(case, jumps)
    return spans & ~jumps


def _may_exceed(
    times: np.ndarray, values: np.ndarray, jumps: np.ndarray, low: float, high: float, tolerance: float
) -> np.ndarray:
    """Return between which instants values (n, k) may exceed their bounds, (n - 1,); none if they do so at one."""
    most, least = high + tolerance, low - tolerance
    if not ((values <= most) & (values >= least)).all():
        return np.zeros(len(times) - 1, bool)
    more = leaves(times, values, jumps)
    above = np.maximum(values[:-1], values[1:]) + more > most + UNDECIDED * tolerance
    below = np.minimum(values[:-1], values[1:]) - more < least - UNDECIDED * tolerance
    return np.any(above | below, axis=1)


def _may_be_short(seen: Instants, jumps: np.ndarray) -> np.ndarray:
    """Return between which instants there may be no tensions inside their limits, (n - 1,).

    Tensions interpolated between two instants are inside their limits, since these are convex. What their wrench misses
    is bounded by its curvature, and is nothing if it is small, or if all cables together can make up for it from what
    they have left to their limits. Where they have not, other tensions of the same instants, far from their limits,
    may.
    """
    resting = seen.scenario.phases.resting(seen.times)
    doubtful = ~(resting[1:] & resting[:-1]) & ~jumps
    doubtful &= _misses(seen, jumps, doubtful)
    spans = np.flatnonzero(doubtful)
    if spans.size:
        near, apart, at = _about(seen, jumps, spans)
        low, high = near.scenario.bounds_at(near.times)
        middle = low + np.minimum((high - low) / 2, near.scenario.robot.force_scale)
        solved = solve_batch(near.A, near.w, low, high, middle)
        near = replace(near, tensions=np.where(solved.feasible[:, None], solved.tensions, near.tensions))
        among = np.zeros(len(apart), bool)
        among[at] = True
        doubtful[spans] = _misses(near, apart, among)[at]
    return doubtful


def _misses(seen: Instants, jumps: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Return `among` which spans (n - 1,) tensions interpolated between two instants miss more than cables make up for.

    With the tensions t of an instant, A t - w is known there and at the instants before and after, which shows how it
    is bent. The tensions change in between too, and A with them.
    """
    scenario, times, A, t, w = seen.scenario, seen.times, seen.A, seen.tensions, seen.w
    h, at = np.diff(times), _product(A, t) - w
    after, before = _product(A[1:], t[:-1]) - w[1:], _product(A[:-1], t[1:]) - w[:-1]
    slopes = (after[1:] - at[1:-1]) / h[1:, None] - (at[1:-1] - before[:-1]) / h[:-1, None]
    bent = np.zeros(len(times))
    bent[1:-1] = 2 * np.linalg.norm(slopes, axis=1) / (h[1:] + h[:-1])
    bent[1:-1][jumps[1:] | jumps[:-1]] = 0.0
    missing = between(times, bent) + np.linalg.norm(at[1:] - after - before + at[:-1], axis=1) / 4
    low, high = scenario.bounds_at(times)
    room = np.minimum(t - low, high - t).clip(0.0, MOST_ROOM * scenario.robot.force_scale)
    room, gains = np.minimum(room[:-1], room[1:]), np.maximum(seen.gains[:-1], seen.gains[1:])
    reached = np.divide(room, gains, out=np.full_like(room, np.inf), where=gains > 0).min(axis=1)
    # Where a cable has no room the others have to make up for it, by changes in proportion to the room of each.
    spans = np.flatnonzero((missing > np.maximum(seen.tolerance, reached)) & among)
    moving = np.flatnonzero(scenario.robot.dof_mask)
    for some in np.split(spans, range(BLOCK, len(spans), BLOCK)):
        weighted = (A[some] + A[some + 1])[:, moving] / 2 * room[some, None, :]
        square = weighted @ weighted.swapaxes(1, 2)
        size = np.einsum("nii->n", square)
        square += (SINGULAR * size + (size == 0))[:, None, None] * np.eye(len(moving))
        inverse = np.linalg.inv(square)
        parts = np.linalg.norm(weighted.swapaxes(1, 2) @ inverse, axis=2).max(axis=1)  # of a cable's room
        # Where these miss a share of a wrench they can make up for it in turn, as for a geometric series, if it is
        # below 1.
        missed = SINGULAR * size * np.linalg.norm(inverse, axis=(1, 2))
        weighted_reach = np.divide((1.0 - missed).clip(0.0), parts, out=np.zeros_like(parts), where=parts > 0)
        reached[some] = np.maximum(reached[some], weighted_reach)
    return (missing > np.maximum(seen.tolerance, reached)) & among


def _product(A: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the wrenches of tensions t (n, m) with matrices A (n, 6, m), (n, 6)."""
    return (A @ t[..., None])[..., 0]
