"""Prove that every motion exceeds limits on speeds and accelerations: `too_fast`.

From one time to another, a body moves at least as far as its places are apart, less its permitted distances from them.
Its mean speed, from which its largest one follows, is at least this distance divided by the time; its largest
acceleration, if it is at rest at one of the times, at least twice the distance divided by the square of the time, and
if it is at rest at both, four times. Inside a tube, second differences bound the acceleration.
"""

from collections.abc import Callable, Iterator

import numpy as np

from ...base.text import quantity
from ...models.points import placed
from ..audits.excess import Excess
from ..limits import Limit, Rate
from ..limits.cables import CableAcceleration, CableSpeed
from ..limits.carriers import CarrierAcceleration, CarrierSpeed
from ..limits.platform import PlatformAcceleration, PlatformSpeed, ZoneSpeed
from ..tasks.scenario import Scenario
from .too_heavy import OF_DURATION, TINY, carriers_of, strongest

CERTAIN = 1e-6  # of the duration


def too_fast(
    scenario: Scenario,
    times: np.ndarray,
    places: np.ndarray,
    spread: np.ndarray,
    resting: np.ndarray,
    still: np.ndarray,
    centres: np.ndarray | None = None,
) -> Iterator[Excess]:
    """Yield each limit that is exceeded, where it is exceeded by most.

    - `times`: equally spaced, from start to end, (n,) [s].
    - `places`: poses of the platform and of each carrier in {G}, without what the planner chooses, (1 + c, n, 6) [m,
      rad].
    - `spread`: how far each of them, and every point of the platform, may be from its place, (1 + c, n) [m].
    - `resting`, `still`: of which of them the origin is at rest at both ends, and which do not turn there either,
      (1 + c,) of bool.
    - `centres`: how far origin and CoM of the platform may be from their places, (2, n) [m]; default: `spread[0]`.
    """
    of_origin, of_com = spread[[0, 0]] if centres is None else centres
    yield from _too_short(scenario, times, places, spread, of_com, bool(still[0]))
    lengths = None
    for limit in scenario.limits:
        if limit.soft is not None or isinstance(limit, Rate):
            continue
        body = 0 if limit.hull is None or limit.hull.carrier is None else 1 + limit.hull.carrier
        x, off, rests = places[body, :, None, :3], (spread[body] if body else of_origin)[:, None], bool(resting[body])
        if isinstance(limit, CableSpeed | CableAcceleration):
            if lengths is None:
                poses = places[0], places[1:].swapaxes(0, 1)
                lengths = scenario.dynamics.cable_lengths(*poses)[..., None]
            ends = (spread[0] + spread[1:][scenario.robot.carrier_of_cable]).T
            x, off, rests = lengths[:, limit.cables], ends[:, limit.cables], bool(still.all())
        if isinstance(limit, PlatformSpeed | CarrierSpeed | CableSpeed):
            yield from _mean_rate(limit, times, x, off)
        elif isinstance(limit, ZoneSpeed):
            yield from _mean_rate(limit, times, limit.way(x), off)
        elif isinstance(limit, PlatformAcceleration | CarrierAcceleration | CableAcceleration):
            yield from _acceleration(limit, times, x, off, rests)


def _too_short(
    scenario: Scenario, times: np.ndarray, places: np.ndarray, spread: np.ndarray, off: np.ndarray, still: bool
) -> Iterator[Excess]:
    """Yield a duration in which cables and gravity cannot accelerate the platform's CoM as much as it must be.

    Where both ends of a span are at rest, the CoM is accelerated along the way and against it: to move by d then takes
    T^2 >= 2 d (1 / a + 1 / b), a and b the largest accelerations along the way and against it.
    """
    if scenario.wind is not None or scenario.phases.all:
        return
    robot = scenario.robot
    com = placed(places[0], np.array([robot.platform.com])) * robot.dof_mask[:3]
    down = _unit(np.array([robot.gravity]) * robot.dof_mask[:3])  # along which suspended platforms hardly accelerate
    along, longest, why = _strength(scenario, places, spread), 1 + CERTAIN, ""
    for mean, less, begins, ends, from_rest in _mean_accelerations(times, com, off[:, None], still):
        ways = np.concatenate([_unit(mean[:, 0]), np.repeat(down, len(mean), axis=0)])
        mean, less, begins, ends = (np.concatenate([part, part]) for part in (mean[:, 0], less[:, 0], begins, ends))
        least = np.einsum("rj,rj->r", mean, ways) - less
        middle = np.searchsorted(times, (begins + ends) / 2).clip(max=len(times) - 1)
        rest_to_rest = from_rest & (ends - begins == times[-1] - times[0])
        doubtful = rest_to_rest | (scenario.stretches & (least > along(ways, middle)))
        for row in np.flatnonzero((least > 0) & doubtful):
            span = np.flatnonzero((times >= begins[row]) & (times <= ends[row]))
            most = float(along(ways[[row]], span).max())
            if rest_to_rest[row]:
                against = float(along(-ways[[row]], span).max())
                most = 2 * most * against / (most + against) if min(most, against) > 0 else 0.0
            if most > 0 and np.sqrt(least[row] / most) > longest:
                longest = float(np.sqrt(least[row] / most))
                why = f"cables and gravity accelerate the platform by at most {quantity(most, 'm/s^2')}"
                why += f" on its way from t = {begins[row]:.3f} s to t = {ends[row]:.3f} s"
    if why:
        whole = float(times[-1] - times[0])
        yield Excess(OF_DURATION, "motion", None, whole, longest * whole, "s", "at least", why)


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (n, 3) with length 1; those without length stay zero."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), TINY)


def _strength(
    scenario: Scenario, places: np.ndarray, spread: np.ndarray
) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Return the function of the platform's largest acceleration along directions (r, 3) near times `at` (r,).

    No cable gives more than its largest tension, flying carriers no more than their thrusts. A cable's direction
    differs from that between the places of its ends by no more than an angle, which follows from how far they are off.
    """
    robot, gravity, known = scenario.robot, np.array(scenario.robot.gravity), carriers_of(scenario)
    low, high = scenario.bounds()
    anchors, attachments = scenario.dynamics.points(places[0], places[1:].swapaxes(0, 1))
    off = (spread[:1] + spread[1:][robot.carrier_of_cable]).T
    for ends in (anchors, attachments):
        steps = np.linalg.norm(np.diff(ends, axis=0), axis=2)
        off = off + np.maximum(np.pad(steps, ((1, 0), (0, 0))), np.pad(steps, ((0, 1), (0, 0))))
    cables = anchors - attachments
    lengths = np.linalg.norm(cables, axis=2)
    known_direction = (off < lengths) & (robot.pulley_radii == 0)
    sines = np.divide(off, lengths, out=np.zeros_like(off), where=known_direction)
    angles = np.where(known_direction, np.arcsin(sines), np.pi)
    units = cables / np.maximum(lengths, TINY)[..., None]

    def along(directions: np.ndarray, at: np.ndarray) -> np.ndarray:
        between = np.arccos(np.clip((units[at] @ directions[..., None])[..., 0], -1.0, 1.0))
        shares = np.cos(np.maximum(between - angles[at], 0.0))
        forces = np.maximum(low * shares, high * shares).sum(axis=1)
        if known is not None and robot.dof_mask[:3].all():
            forces = np.minimum(forces, strongest(known, directions, gravity))
        return forces / robot.platform.mass + directions @ gravity

    return along


def _mean_rate(limit: Limit, times: np.ndarray, x: np.ndarray, off: np.ndarray) -> Iterator[Excess]:
    """Yield the limit of a rate if the mean rate of some vector x (n, k, d), less off (n, k), exceeds it."""
    first, last = np.triu_indices(len(times), 1)
    moved = np.linalg.norm(x[last] - x[first], axis=2) - off[last] - off[first]
    rate = moved / (times[last] - times[first])[:, None]
    pair, which = np.unravel_index(rate.argmax(), rate.shape)
    if rate[pair, which] > limit.high + limit.tolerance:
        begin, end = float(times[first[pair]]), float(times[last[pair]])
        why = f"the smallest possible mean speed from then to t = {end:.3f} s"
        yield Excess(limit.name, limit.labels[which], begin, float(rate[pair, which]), limit.high, limit.unit, why=why)


def _acceleration(limit: Limit, times: np.ndarray, x: np.ndarray, off: np.ndarray, rests: bool) -> Iterator[Excess]:
    """Yield the limit of an acceleration if motions within off (n, k) of vectors x (n, k, d) must exceed it."""
    worst, begin, end = (-np.inf, 0), 0.0, 0.0
    for mean, less, begins, ends, _ in _mean_accelerations(times, x, off, rests):
        least = np.linalg.norm(mean, axis=2) - less
        row, which = np.unravel_index(least.argmax(), least.shape)
        if least[row, which] > worst[0]:
            worst, begin, end = (float(least[row, which]), int(which)), float(begins[row]), float(ends[row])
    value, which = worst
    if value > limit.high + limit.tolerance:
        at_rest = [rests and time in times[[0, -1]] for time in (begin, end)]
        why = f"the smallest possible from t = {begin:.3f} s to t = {end:.3f} s"
        if any(at_rest):
            why += " from rest to rest" if all(at_rest) else f", with rest at the {'start' if at_rest[0] else 'end'}"
        yield Excess(limit.name, limit.labels[which], (begin + end) / 2, value, limit.high, limit.unit, why=why)


def _mean_accelerations(
    times: np.ndarray, x: np.ndarray, off: np.ndarray, rests: bool
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, bool]]:
    """Yield weighted means of accelerations (r, k, d), by how much they may differ (r, k), and when they are.

    The latter are the times at which their spans begin and end, (r,) each, and whether there is a rest at one of these.
    """
    for steps in range(1, (len(times) - 1) // 2 + 1):
        before, here, after = slice(None, -2 * steps), slice(steps, -steps), slice(2 * steps, None)
        square = (times[steps] - times[0]) ** 2
        bent, less = x[before] - 2 * x[here] + x[after], off[before] + 2 * off[here] + off[after]
        yield bent / square, less / square, times[before], times[after], False
    if rests:
        for end in (0, -1):
            spans, other = np.delete(times - times[end], end), np.delete(times, end)
            # From one rest to the other half the way is accelerated, and the other half in the opposite direction.
            factors = np.where(other == times[-1 - end], 4.0, 2.0) / np.square(spans)
            moved, less = (np.delete(part, end, axis=0) for part in (x - x[end], off + off[end]))
            whole, begins = factors[:, None] * less, np.minimum(other, times[end])
            yield factors[:, None, None] * moved, whole, begins, np.maximum(other, times[end]), True
