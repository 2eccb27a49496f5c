"""`with_clear_ends`: formations and attitudes at start and end that keep all limits, where the task leaves them free.

A formation that starts at home may stand in the way of an obstacle, although its task lets it start with any other. So
may a platform with the attitude of its path.
"""

from dataclasses import replace

import numpy as np

from ..tasks.ends import carrier_ends, fixed_values
from ..tasks.scenario import ATTITUDE
from .at_rest import AtRest
from .clear_space import FORMATIONS, grown
from .space import Space

YAW = 5
MOST_TURN = 0.4  # [rad], by which the platform starts or ends turned
SPARE = 2.0  # times the reserve, which is kept if there is space
AWAY = 0.02  # metres of slack that a metre away from the usual formation is worth


def with_clear_ends(space: Space, rest: AtRest, reserve: float) -> Space:
    """Return the space with ends near the usual ones that keep all limits by the reserve [m], if they are found."""
    if carrier_ends(space.scenario.task) == "periodic":
        return space
    rng, ends = np.random.default_rng(0), space.ends.copy()
    for k, slack in enumerate(rest(*space.poses(ends)).slack):
        free = _free(space, k)
        if slack < reserve and free is not None:
            ends[k] = _clear_end(space, rest, ends[k], free, reserve, rng)
    return replace(space, given_ends=ends)


def _free(space: Space, end: int) -> np.ndarray | None:
    """Return by how much each coordinate may change at an end, (count,); None if its formation may not."""
    scenario, platform = space.scenario, space.scenario.platform_free
    fixed = {each.column for each in fixed_values(scenario) if each.order == 0 and each.end == -end}
    owners = scenario.owners()
    if any(owners[column][0] is not None for column in fixed):
        return None
    free = np.zeros(space.count)
    free[len(platform) :] = np.inf if space.shaped else 0.0
    turning = (YAW,) if space.shaped else ATTITUDE  # a formation carries its load level
    for column, coordinate in enumerate(platform):
        if coordinate in turning and column not in fixed:
            free[column] = min(scenario.task.tube.turn, MOST_TURN)
    return free if free.any() else None


def _clear_end(
    space: Space, rest: AtRest, end: np.ndarray, free: np.ndarray, reserve: float, rng: np.random.Generator
) -> np.ndarray:
    """Return the configuration nearest to `end` that keeps the reserve, or the one that misses it by least."""

    def inside(tried: np.ndarray) -> np.ndarray:
        return np.clip(tried, end - free, end + free)

    def score(tried: np.ndarray) -> np.ndarray:
        slack = rest(*space.poses(inside(tried))).slack
        away = np.linalg.norm((inside(tried) - end) * space.scale, axis=1)
        return np.minimum(slack, SPARE * reserve) - np.where(slack >= reserve, AWAY * away, AWAY * space.size)

    formation = np.isinf(free)
    first = np.repeat(end[None], FORMATIONS, axis=0)
    first[1:] += rng.uniform(-1.0, 1.0, first[1:].shape) * np.where(formation, 0.0, free)
    if formation.any():
        first[1:, formation] = [space.sample_shape(rng) for _ in range(FORMATIONS - 1)]
    return inside(grown(space, first, score, np.minimum(free, 1.0), rng)[0])
