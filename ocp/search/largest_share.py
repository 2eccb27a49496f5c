"""Find the largest variation of a task that is feasible: `largest_share` of one change, `together` of several."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ...base.errors import InputError
from ...solvers import solve_batch
from ..global_path.at_rest import AtRest
from ..global_path.space import Space
from ..plan import Plan
from ..proofs.infeasible_ends import infeasible_ends
from ..result import Relaxed
from ..tasks.ends import fixed_values
from ..tasks.lay_out import with_task
from ..tasks.paths import AnyPath
from ..tasks.scenario import Scenario
from ..tasks.wind_set import possible_winds_at
from .refinement import planned, rounded
from .search import Search

INSTANTS = 120  # at which tensions must exist before a motion is audited, besides those at which audits failed
HALVINGS, OF_PROOFS = 10, 6  # the latter where a program decides what is offered
# Halvings without a feasible scenario, until the least share decides: with that, a platform may be too light for t_min.
HOPELESS = 3
RESERVES = 1.0, 0.98, 0.9  # of the largest share with tensions at these instants, until an audit passes
OF_PROGRAMS = 0.5, 0.9  # of it, if programs decide: in order until one has no solution
LEAST = 0.1  # of it, if the first one has none
ORDERS = {"/s": 1, "W": 1, "/s^2": 2, "/s^3": 3}  # of the rates with such units, which fall with 1/T to that power
EASE, PLACES = 0.1, 61  # of the acceleration of gravity, along the path, and places of it
HURRIED = 2.0  # times shorter than with small accelerations: flying carriers hardly move a load any faster
EASIEST = 1e-3  # the share at which changes together are as easy as can be

Variation: TypeAlias = tuple[Scenario, float, str]
"""The scenario of a varied task, the value in which it differs, and a text that follows the value in reports."""


class Change(NamedTuple):
    """A change of a task or a robot: `at(share)` is the variation with this share of what is given.

    At 1 it is what is given, or nearly; towards 0 it becomes easier. `up` states whether its value is rounded up.
    """

    name: str
    unit: str
    at: Callable[[float], Variation]
    up: bool = False
    requested: float | None = None  # what is given, if it is not the value at 1
    least: float = EASIEST  # the share below which little is left of the task

    def offer(self, share: float, plan: Plan) -> Relaxed:
        """Return the relaxation of a feasible plan with this share."""
        _, value, detail = self.at(share)
        requested = self.at(1.0)[1] if self.requested is None else self.requested
        return Relaxed(self.name, self.unit, requested, rounded(value, self.up), plan, detail)


Maker: TypeAlias = Callable[[Scenario], Change | None]
"""A function that returns a change of a scenario, or None if it has nothing to change."""


def largest_share(search: Search, change: Change | None) -> list[Relaxed]:
    """Return the variation with the largest share that passes its audit; [] if none is found."""
    if change is None or search.cut_short:
        return []
    largest = _largest(search, lambda share: change.at(share)[0], least=change.least)
    name = f"audit, other {change.name}"
    found = _planned(search, lambda part: change.at(part * largest)[0], name) if largest else None
    return [] if found is None else [change.offer(found[0] * largest, found[1])]


def together(search: Search, scenario: Scenario, makers: Sequence[Maker]) -> list[Relaxed]:
    """Return changes that make a motion feasible only together; [] if all of them do not.

    Each change is as easy as can be at first. In the order of `makers`, each is left out if the others suffice without
    it. The others have the largest share that all can have, and then each as much as it can. If only programs show what
    suffices, and they do not find a motion with the few changes left, all are tried.
    """

    def easy(makers: Sequence[Maker]) -> bool:
        easiest = _legal(lambda share: _changed(scenario, makers, np.full(len(makers), share))[1], EASIEST)
        return easiest is not None and _may_be_feasible(search, easiest)

    kept = every = [make for make in makers if make(scenario) is not None]
    if search.cut_short or not easy(every):
        return []
    for make in tuple(every):
        others = [each for each in kept if each is not make]
        kept = others if easy(others) else kept
    found = _with_shares(search, scenario, kept)
    if found is None and by_programs(scenario) and len(kept) < len(every):
        kept, found = every, _with_shares(search, scenario, every)
    if found is None:
        return []
    shares, plan = found
    changes, _ = _changed(scenario, kept, shares)
    offered = zip(changes, shares, strict=True)
    return [change.offer(max(float(share), change.least), plan) for change, share in offered]


def _with_shares(search: Search, scenario: Scenario, makers: Sequence[Maker]) -> tuple[np.ndarray, Plan] | None:
    """Return the largest shares of changes together whose plan is feasible, and this plan; None if none is found."""

    def at(shares: np.ndarray) -> Scenario:
        return _changed(scenario, makers, shares)[1]

    every = np.ones(len(makers))
    shares = every * _largest(search, lambda share: at(share * every), EASIEST)  # the same for all
    for row in np.eye(len(makers), dtype=bool):
        one = partial(lambda row, others, share: at(np.where(row, share, others)), row, shares)
        shares = np.where(row, _largest(search, one, shares.min()), shares)
    found = _planned(search, lambda part: at(part * shares), "audit, changes together")
    return found and (found[0] * shares, found[1])


def _changed(scenario: Scenario, makers: Sequence[Maker], shares: np.ndarray) -> tuple[list[Change], Scenario]:
    """Return changes, each of the scenario that the previous ones have changed, and the scenario with all of them.

    Each is made with its share, or with the least one that it allows.
    """
    changes = []
    for make, share in zip(makers, shares, strict=True):
        if (change := make(scenario)) is not None:
            changes.append(change)
            scenario = change.at(max(float(share), change.least))[0]
    return changes, scenario


def _largest(search: Search, at: Callable[[float], Scenario], low: float = 0.0, least: float = EASIEST) -> float:
    """Return the largest share from a low one on whose scenario may be feasible; the low one if none is known.

    If the first halvings find none, the search goes on only if the scenario of the `least` share may be feasible.
    """

    def possible(share: float) -> bool:
        varied = _legal(at, share)
        return varied is not None and _may_be_feasible(search, varied)

    high = 1.0
    for halving in range(OF_PROOFS if (most := _legal(at, 1.0)) and by_programs(most) else HALVINGS):
        if halving == HOPELESS and not low and not possible(least):
            break
        middle = (low + high) / 2
        low, high = (middle, high) if possible(middle) else (low, middle)
    return low


def _planned(search: Search, at: Callable[[float], Scenario], name: str) -> tuple[float, Plan] | None:
    """Return the largest part of a share at which a plan is feasible, and this plan; None if none is found."""

    def tried(part: float, near: Plan | None = None) -> tuple[float, Plan] | None:
        varied = _legal(at, part)
        guess = None if near is None else near.deviation
        plan = None if varied is None else planned(search, varied, name, guess)
        return None if plan is None else (part, plan)

    if not ((most := _legal(at, 1.0)) and by_programs(most)):
        part = 1.0
        for reserve in RESERVES:
            if part and (found := tried(reserve * part)):
                return found
            part = _largest(search, at)
        return None
    best: tuple[float, Plan] | None = None
    for part in OF_PROGRAMS:
        if not (larger := tried(part, best and best[1])):
            break
        best = larger
    return best or tried(LEAST)


def by_programs(scenario: Scenario) -> bool:
    """Return whether only a program shows if a motion is feasible.

    Carriers are free, given states are off the path, or few cables let the platform tilt.
    """
    away = scenario.count > 0 and any(fixed.value for fixed in fixed_values(scenario))
    tilts = scenario.robot.m < scenario.robot.dof_mask.sum() and bool(scenario.task.tube.turn)
    return bool(scenario.carrier_free) or away or tilts


def _legal(at: Callable[[float], Scenario], share: float) -> Scenario | None:
    """Return a variation, or None if its task is refused: exact waypoints may be outside the tube of other legs."""
    try:
        return at(share)
    except InputError:
        return None


def _may_be_feasible(search: Search, scenario: Scenario) -> bool:
    """Return whether limits and tensions permit some instants of a fixed motion, tensions only off the ground.

    If only a program shows whether there is a motion, return whether nothing proves that there is none.
    """
    if by_programs(scenario):
        hurried = bool(scenario.carrier_free) and at_ease(scenario) > HURRIED * scenario.duration
        return not hurried and rests(scenario) and infeasible_ends(scenario) is None
    shares = np.append(np.linspace(0.0, 1.0, INSTANTS), [*search.failed])
    times = scenario.duration * np.unique(shares)
    if exceeds(scenario, times).any():
        return False
    times = times[~scenario.phases.resting(times)]
    platform, carriers = scenario.motion(times, None)
    mask = scenario.robot.dof_mask
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


def at_ease(scenario: Scenario) -> float:
    """Return the duration in which the platform's acceleration on its path is at most `EASE` of gravity's [s]."""
    times = np.linspace(0.0, scenario.duration, PLACES)
    fastest = np.linalg.norm(scenario.motion(times, None)[0].acceleration[:, :3], axis=1).max()
    of_weight = scenario.robot.force_scale / scenario.robot.platform.mass
    return float(scenario.duration * np.sqrt(fastest / (EASE * of_weight)))


def rests(scenario: Scenario) -> bool:
    """Return whether tensions hold the platform at rest at both ends, with carriers where they are at first."""
    space = Space(scenario)
    return bool((AtRest(scenario, space.size)(*space.poses(space.ends)).worst >= 0).all())


def exceeds(scenario: Scenario, times: np.ndarray, rates: bool = True) -> np.ndarray:
    """Return at which of `times` (n,) a fixed motion exceeds a hard limit that does not depend on tensions.

    Without `rates`, speeds and accelerations are left out.
    """
    limits, motion, exceeded = scenario.limits, scenario.motion(times, None), np.zeros(len(times), dtype=bool)
    for limit, values in zip(limits, limits.along(*motion), strict=True):
        counts = rates or not limit.unit.endswith(tuple(ORDERS))
        if counts and limit.soft is None and limit.name not in limits.of_tensions:
            values = np.where(scenario.in_force(limit, times)[:, None], values, np.nan)
            over = limit.over(times, values)
            beyond = (over > limit.high + limit.tolerance) | (over < limit.low - limit.tolerance)
            exceeded |= beyond.any(axis=1)
    return exceeded


def along(scenario: Scenario, path: AnyPath) -> Scenario:
    """Return the scenario along another path. A given state at an end of the path moves with it."""
    times, changes = np.array([0.0, scenario.duration]), dict[str, Any](path=path)
    motion = scenario.along(path, scenario.duration).motion(times, None)[0]
    for row, key in enumerate(("initial", "final")):
        state, moved = getattr(scenario.task, key), dict[str, tuple[float, ...]]()
        for name, values in zip(("pose", "velocity", "acceleration"), motion, strict=True):
            given = None if state is None else getattr(state, name)
            if given is not None:
                fixed = ~np.isin(np.arange(6), scenario.platform_free)
                moved[name] = tuple(np.where(fixed, values[row], given).tolist())
        if state is not None:
            changes[key] = state.model_copy(update=moved)
    return with_task(scenario, **changes)
