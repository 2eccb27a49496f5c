"""Bound distances between the instants of an audit, however fast the motion is: `came_too_near`.

A plane between two bodies, known at one instant, proves a distance at each other one: the distance of the points of
both from it. It is exact where they moved straight on, and lower where they turned about each other. Both planes of two
instants bound the distance in between, less what the points leave the straight line by. Where that does not decide, the
instant in the middle is looked at, and so on: a distance that is too small by more than the limit's tolerance is found.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from ...models.batch import in_blocks
from ..limits.distance import Distance
from ..limits.limits import Separating, motions
from ..tasks.paths import Motion
from .excess import Excess
from .instants import Instants
from .peaks import is_jump, leaves

UNDECIDED = 0.05  # of a limit's tolerance: less than that beside it is not looked for
DEEPEST = 0.99  # of the largest excess is found
MOST_HALVES = 50
PARTS = 4  # of the time between two instants at which a distance is known, where it may be too small in between

_Least: TypeAlias = tuple[float, int, float]
"""Time, index and value of a distance."""


def came_too_near(audited: Instants) -> list[Excess]:
    """Return the limits of distances that are not kept, at the instants of the audit or between them."""
    exceeded = dict[tuple[str, str, float], Excess]()
    chosen = [limit for limit in audited.scenario.limits if isinstance(limit, Distance)]
    moved = _moved(audited) if chosen else np.zeros(0)
    for limit in chosen:
        values = _values(audited, limit, moved)
        holds = audited.scenario.in_force(limit, audited.times)
        slack = np.where(np.isnan(values), -np.inf, values - limit.low + limit.tolerance)
        slack[~holds] = np.inf
        if not holds.any():
            continue
        row, which = np.unravel_index(slack.argmin(), slack.shape)
        least: _Least = (float(audited.times[row]), int(which), float(values[row, which]))
        far = np.isfinite(limit.per_metre) and (slack[:-1] + slack[1:] >= limit.per_metre * moved[:, None]).all()
        if not far and np.isfinite(slack[holds]).all():
            least = _least(audited, limit, values, holds, least)
        time, which, value = least
        if not value >= limit.low - limit.tolerance:
            facts = (time, value, limit.low, limit.unit, "at least")
            pair = limit.name, limit.about(which), limit.low
            if pair not in exceeded or value < exceeded[pair].value:  # a body and a region may have two limits
                between = _between_nodes(audited, limit, time, which, value)
                exceeded[pair] = Excess(limit.name, limit.about(which), *facts, between=between)
    return list(exceeded.values())


def _values(audited: Instants, limit: Distance, moved: np.ndarray) -> np.ndarray:
    """Return the distances of a limit at all instants, (n, k) [m].

    No point moves by more than `moved` (n - 1,) [m] from one to the next. Where this shows that distances are larger
    than the limit at all times between some instants, those in between are what they are at least.
    """
    scenario, n = audited.scenario, len(audited.times)
    if not (np.isfinite(limit.per_metre) and np.isfinite(moved).all()):
        return scenario.limits.distances(limit, audited.motion, audited.carriers)
    changes = limit.per_metre * moved
    way, enough = np.insert(np.cumsum(changes), 0, 0.0), limit.low + changes.max(initial=0.0)
    values, known, more = np.empty((n, len(limit.labels))), np.zeros(n, bool), np.r_[0 : n - 1 : PARTS**3, n - 1]
    while more.size:
        platform, carriers = audited.motion.at(more), audited.carriers.at(more)
        values[more], known[more] = scenario.limits.distances(limit, platform, carriers), True
        at = np.flatnonzero(known)
        first, last = at[:-1], at[1:]
        least = (values[first] + values[last] - (way[last] - way[first])[:, None]) / 2
        undecided = (last - first > 1) & ~(least.min(axis=1) >= enough)
        inner = np.linspace(first[undecided], last[undecided], PARTS + 1).astype(int)
        more = np.setdiff1d(inner, at)
        values = np.where(known[:, None], values, np.vstack([np.repeat(least, last - first, axis=0), values[-1:]]))
    return values


def _between_nodes(audited: Instants, limit: Distance, time: float, which: int, value: float) -> float | None:
    """Return the distance of a pair at a time between two nodes, from the planes between its bodies at these [m].

    So much more distance at the nodes keeps one out of the other, however thin it is; it is at most `value`, which is
    less at the corner of a thick one. If the planes show that it is on the other side at the second node, none does.
    """
    if audited.deviation is None:
        return None
    nodes, separating = audited.deviation.nodes, audited.scenario.limits.separating(limit)
    after = int(np.clip(np.searchsorted(nodes, time), 1, len(nodes) - 1))
    both = np.full(2, which)
    at_nodes, there = (_at(audited, separating, at, both) for at in (nodes[after - 1 : after + 1], np.full(2, time)))
    passes = at_nodes.normal[0] @ at_nodes.normal[1] < 0
    return limit.low if passes else min(value, float(_from_plane(separating, at_nodes, there).max()))


def _moved(audited: Instants) -> np.ndarray:
    """Return how far any point of platform and carriers moves at most from one instant to the next, (n - 1,) [m]."""
    points = audited.scenario.moving_points(audited.motion.pose, audited.carriers.pose)
    return _ways(audited.times, points).max(axis=1)


def _ways(times: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return how far points (n, ..., 3) are at most from both their places at two instants, together, (n - 1, ...)."""
    return np.linalg.norm(np.diff(points, axis=0), axis=-1) + 2 * _bends(times, points)


def _bends(times: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return how far points (n, ..., 3) leave the straight way from instant to instant at most, (n - 1, ...) [m]."""
    return np.linalg.norm(leaves(times, points, is_jump(times)), axis=-1)


class _Ends(NamedTuple):
    """Pairs of bodies at one instant each: time, points, distances, and directions of the planes between them."""

    time: np.ndarray  # (k,)
    points: np.ndarray  # (k, s, 3)
    distance: np.ndarray  # (k,)
    normal: np.ndarray  # (k, 3)

    def of(self, rows: np.ndarray) -> _Ends:
        return _Ends(*(part[rows] for part in self))


def _least(audited: Instants, limit: Distance, values: np.ndarray, holds: np.ndarray, found: _Least) -> _Least:
    """Return the smallest distance over all time if it is too small, else one that is not; `found` is as in `values`.

    `holds` is at which instants the limit holds, (n,). Wherever the distance may be too small, and less than the
    smallest so far, the instant in the middle is looked at.
    """
    separating, times = audited.scenario.limits.separating(limit), audited.times
    points = _points(separating, audited.motion, audited.carriers)
    ways, bends = _both(separating, _ways(times, points)), _both(separating, _bends(times, points))
    wanted = _wanted(limit, found)
    looked_at = ~is_jump(times) & holds[:-1] & holds[1:]
    row, which = np.nonzero((values[:-1] + values[1:] - ways < 2 * wanted) & looked_at[:, None])
    first, last = (_ends(separating, times[at], points[at, which]) for at in (row, row + 1))
    bend, way = bends[row, which], ways[row, which]
    for _ in range(MOST_HALVES):
        lowest = np.fmax(_bound(separating, first, last) - bend, (first.distance + last.distance - way) / 2)
        undecided = np.flatnonzero(~(lowest >= wanted))
        if not undecided.size:
            break
        first, last, which, bend = first.of(undecided), last.of(undecided), which[undecided], bend[undecided] / 4
        middle = _at(audited, separating, (first.time + last.time) / 2, which)
        nearest = int(middle.distance.argmin())
        if middle.distance[nearest] < found[2]:
            found = float(middle.time[nearest]), int(which[nearest]), float(middle.distance[nearest])
            wanted = _wanted(limit, found)
        first, last = _together(first, middle), _together(middle, last)
        which, bend = np.tile(which, 2), np.tile(bend, 2)
        way = _both(separating, np.linalg.norm(last.points - first.points, axis=-1)) + 2 * bend
    return found


def _wanted(limit: Distance, found: _Least) -> float:
    """Return the distance below which one is looked for: too small, and clearly less than the smallest so far."""
    too_small = limit.low - (1 + UNDECIDED) * limit.tolerance
    return min(too_small, limit.low - (limit.low - found[2]) / DEEPEST)


def _together(some: _Ends, others: _Ends) -> _Ends:
    return _Ends(*(np.concatenate(pair) for pair in zip(some, others, strict=True)))


def _both(separating: Separating, values: np.ndarray) -> np.ndarray:
    """Return the sum of the largest values (..., s) of the points of both bodies, (...,)."""
    moving = separating.moving
    return values[..., :moving].max(axis=-1) + values[..., moving:].max(axis=-1, initial=0.0)


def _bound(separating: Separating, first: _Ends, last: _Ends) -> np.ndarray:
    """Return the least distance that the planes at both ends leave if the points move straight in between, (k,).

    A plane's distance from both bodies is concave then: it is nowhere below the line between its values at both ends.
    """
    falls = [here.distance - _from_plane(separating, here, there) for here, there in ((first, last), (last, first))]
    fall, rise = (np.maximum(each, 0.0) for each in falls)
    total = fall + rise
    apart = first.distance - (last.distance - rise)  # of both lines, at the start
    share = np.clip(np.divide(apart, total, out=np.zeros_like(total), where=total > 0), 0.0, 1.0)
    return np.where(fall == 0, first.distance, np.where(rise == 0, last.distance, first.distance - share * fall))


def _from_plane(separating: Separating, here: _Ends, there: _Ends) -> np.ndarray:
    """Return the distance that the plane between two bodies proves when their points are elsewhere, (k,)."""
    moving, value = separating.moving, here.distance.copy()
    for sign, at in ((1, there), (-1, here)):
        along = np.einsum("ksi,ki->ks", at.points, here.normal)
        value += sign * along[:, :moving].min(axis=1)
        if along.shape[1] > moving:
            value -= sign * along[:, moving:].max(axis=1)
    return value


def _ends(separating: Separating, times: np.ndarray, points: np.ndarray) -> _Ends:
    """Return distances and planes of pairs of bodies by their points (k, s, 3)."""
    planes = in_blocks(separating.plane, [points.reshape(len(points), -1)])[0] if len(points) else np.zeros((0, 4))
    return _Ends(times, points, planes[:, 0], planes[:, 1:])


def _points(separating: Separating, platform: Motion, carriers: Motion) -> np.ndarray:
    """Return the points of all pairs along a motion, (n, pairs, s, 3)."""
    (values,) = in_blocks(separating.points, motions(platform, carriers))
    return values.reshape(len(values), separating.pairs, -1, 3)


def _at(audited: Instants, separating: Separating, times: np.ndarray, which: np.ndarray) -> _Ends:
    """Return the pairs `which` (k,) at other `times` (k,)."""
    instants, rows = np.unique(times, return_inverse=True)
    points = _points(separating, *audited.scenario.motion(instants, audited.deviation))
    return _ends(separating, times, points[rows, which])
