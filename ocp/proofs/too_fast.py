"""Prove that every motion exceeds limits on speeds and accelerations: `too_fast`.

From one time to another, a body moves at least as far as its places are apart, less its permitted distances from them.
Its mean speed, from which its largest one follows, is at least this distance divided by the time; its largest
acceleration, if it is at rest at one of the times, at least twice the distance divided by the square of the time, and
if it is at rest at both, four times. Inside a tube, second differences bound the acceleration.
"""

from collections.abc import Iterator

import numpy as np

from ...base.text import quantity
from ...models.points import placed
from ..audits.excess import Excess
from ..limits import Limit, Rate
from ..limits.cables import CableAcceleration, CableSpeed
from ..limits.carriers import CarrierAcceleration, CarrierSpeed
from ..limits.platform import PlatformAcceleration, PlatformSpeed, ZoneSpeed
from ..tasks.scenario import Scenario
from .too_weak_carriers import OF_DURATION, carriers_of, strongest

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
    yield from _too_short(scenario, times, places[0], of_com, bool(still[0]))
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
    scenario: Scenario, times: np.ndarray, poses: np.ndarray, off: np.ndarray, still: bool
) -> Iterator[Excess]:
    """Yield a duration that is too short for all cables together to accelerate the platform's CoM and stop it again.

    The acceleration at some time is at least four times the distance divided by the square of the duration, along the
    way or against it. No cable gives more than its largest tension, flying carriers no more than their thrusts, and the
    weight contributes at most its own magnitude.
    """
    robot = scenario.robot
    if not still or scenario.wind is not None or scenario.phases.all:
        return
    ends = placed(poses[[0, -1]], np.array([robot.platform.com]))[:, 0]
    way, gravity = ends[1] - ends[0], np.array(robot.gravity)
    moved = float(np.linalg.norm(way) - off[-1] - off[0])
    if moved <= 0.0:
        return
    most, what = float(robot.t_max.sum()) / robot.platform.mass + float(np.linalg.norm(gravity)), "cables at t_max"
    if (known := carriers_of(scenario)) is not None and robot.dof_mask[:3].all():
        both = np.outer((1, -1), way / np.linalg.norm(way))
        pushed = float((strongest(known, both, gravity) / robot.platform.mass + both @ gravity).max())
        most, what = min((most, what), (pushed, "carriers at their largest thrusts"))
    whole, least = float(times[-1] - times[0]), 2 * np.sqrt(moved / most)
    if whole < (1 - CERTAIN) * least:
        why = f"all {what}, and gravity, accelerate the platform by at most {quantity(most, 'm/s^2')}"
        yield Excess(OF_DURATION, "motion", None, whole, float(least), "s", "at least", why)


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
    for least, begins, ends in _least_accelerations(times, x, off, rests):
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


def _least_accelerations(
    times: np.ndarray, x: np.ndarray, off: np.ndarray, rests: bool
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield bounds of accelerations, (r, k), with the times at which their spans begin and end, (r,) each."""
    for steps in range(1, (len(times) - 1) // 2 + 1):
        before, here, after = slice(None, -2 * steps), slice(steps, -steps), slice(2 * steps, None)
        bent = np.linalg.norm(x[before] - 2 * x[here] + x[after], axis=2) - off[before] - 2 * off[here] - off[after]
        yield bent / (times[steps] - times[0]) ** 2, times[before], times[after]
    if rests:
        for end in (0, -1):
            moved = np.linalg.norm(x - x[end], axis=2) - off - off[end]
            spans, other = np.delete(times - times[end], end), np.delete(times, end)
            factors = np.where(other == times[-1 - end], 4.0, 2.0)  # the other end is at rest too
            least = factors[:, None] * np.delete(moved, end, axis=0) / np.square(spans)[:, None]
            yield least, np.minimum(other, times[end]), np.maximum(other, times[end])
