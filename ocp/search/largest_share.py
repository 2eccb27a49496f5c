"""Find the largest variation of a task that is feasible: `largest_share`."""

from collections.abc import Callable
from itertools import product
from typing import TypeAlias

import numpy as np

from ...base.errors import InputError
from ...solvers import solve_batch
from ..proofs.infeasible_ends import infeasible_ends
from ..result import Relaxed
from ..tasks.scenario import ATTITUDE, Scenario
from ..tasks.wind_set import possible_winds_at
from .relaxations import ORDERS, planned, rounded
from .search import Search

INSTANTS = 120  # at which tensions must exist before a motion is audited
HALVINGS = 10
RESERVES = 1.0, 0.98, 0.9  # of the largest share with tensions at these instants, tried in order until an audit passes
OF_PROGRAMS = 0.25, 0.5, 0.75, 0.9  # of it, if programs decide: in order until one has no solution
LEAST = 0.1  # of it, if the first one has none

Variation: TypeAlias = tuple[Scenario, float, str]
"""The scenario of a varied task, the value in which it differs, and a text that follows the value in reports."""


def largest_share(
    search: Search,
    make: Callable[[float], Variation],
    name: str,
    unit: str,
    up: bool = False,
    most: float = 1.0,
    rates: bool = False,
) -> list[Relaxed]:
    """Return the variation with the largest share, from 0 to `most`, that passes its audit; [] if none is found.

    With `rates` the share decides about speeds and accelerations too, as that of a duration does.
    """

    def tried(reserve: float, near: list[Relaxed] | None = None) -> list[Relaxed]:
        varied = _legal(make, reserve * low)
        guess = near[0].plan.deviation if near else None
        plan = varied and planned(search, varied[0], f"audit, other {name}", guess)
        return [Relaxed(name, unit, make(1.0)[1], rounded(varied[1], up), plan, varied[2])] if varied and plan else []

    low, high = 0.0, most
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        varied = _legal(make, middle)
        low, high = (middle, high) if varied and _may_be_feasible(varied[0], rates) else (low, middle)
    if low == 0.0:
        return []
    if not by_programs(make(low)[0]):
        return next(filter(None, map(tried, RESERVES)), [])
    best: list[Relaxed] = []
    for reserve in OF_PROGRAMS:
        if not (larger := tried(reserve, best)):
            break
        best = larger
    return best or tried(LEAST)


def by_programs(scenario: Scenario) -> bool:
    """Return whether only a program shows if a motion is feasible: carriers are free, or few cables let it tilt."""
    return bool(scenario.carrier_free) or _tilts(scenario)


def _tilts(scenario: Scenario) -> bool:
    """Return whether the tube frees the attitude of a platform with fewer cables than degrees of freedom."""
    return scenario.robot.m < scenario.robot.dof_mask.sum() and bool(scenario.task.tube.turn)


def _legal(make: Callable[[float], Variation], share: float) -> Variation | None:
    """Return a variation, or None if its task is refused: exact waypoints may be outside the tube of other legs."""
    try:
        return make(share)
    except InputError:
        return None


def _may_be_feasible(scenario: Scenario, rates: bool) -> bool:
    """Return whether limits and tensions permit some instants of a fixed motion, tensions only off the ground.

    If carriers are free, return whether nothing proves that they cannot hold the platform. If it tilts, tensions need
    only exert the force.
    """
    if scenario.carrier_free:
        return infeasible_ends(scenario) is None
    times = np.linspace(0.0, scenario.duration, INSTANTS)
    if exceeds(scenario, times, rates):
        return False
    times = times[~scenario.phases.resting(times)]
    platform, carriers = scenario.motion(times, None)
    mask = scenario.robot.dof_mask.copy()
    if _tilts(scenario):
        mask[list(ATTITUDE)] = 0
    A = scenario.dynamics.wrench_matrix(platform.pose, carriers.pose) * mask[:, None]
    low, high = scenario.bounds_at(times)
    winds = [scenario.wind]
    if scenario.wind_set is not None:
        winds = possible_winds_at(scenario.wind_set, scenario.robot, platform.pose, platform.velocity)
    for wind, extreme in product(winds, (None, *range(scenario.phases.extremes))):
        w = scenario.required_wrench(times, platform, carriers, wind, extreme) * mask
        if (solve_batch(A, w, low, high, length=scenario.robot.length).code != 0).any():
            return False
    return True


def exceeds(scenario: Scenario, times: np.ndarray, rates: bool) -> bool:
    """Return whether a fixed motion exceeds a hard limit that does not depend on tensions at some of `times`.

    Without `rates`, speeds and accelerations are left out.
    """
    limits, motion = scenario.limits, scenario.motion(times, None)
    for limit, values in zip(limits, limits.along(*motion), strict=True):
        counts = rates or not limit.unit.endswith(tuple(ORDERS))
        if counts and limit.soft is None and limit.name not in limits.of_tensions:
            values = np.where(scenario.in_force(limit, times)[:, None], values, np.nan)
            over = limit.over(times, values)
            if (over > limit.high + limit.tolerance).any() or (over < limit.low - limit.tolerance).any():
                return True
    return False
