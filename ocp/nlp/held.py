"""`held_spans`: when a task fixes what a limit bounds, so that a tightened program keeps the limit itself there.

A load that starts on the floor of its box cannot start above it: with a tighter limit at its fixed start no motion
exists. From such an instant on, a program is tightened by as much as a motion from there can do, which is the third
power of the time.
"""

from collections.abc import Callable, Iterable
from typing import TypeAlias

import casadi as ca
import numpy as np

from ...solvers import solve_batch
from ..limits import Angle, Limit, Rate
from ..tasks.deviation import Deviation
from ..tasks.ends import between_fixed_values, fixed_values
from ..tasks.paths import Motion
from ..tasks.scenario import Scenario

EASE = 0.1  # of the duration, after which all of a limit is tightened

Spans: TypeAlias = tuple[tuple[float, float], ...]
"""First and last instant of each, as shares of the duration."""

EVERYWHERE: Spans = ((0.0, 1.0),)

_Coordinate: TypeAlias = tuple[int | None, int, int]  # owner (None: the platform), coordinate, order of its derivative


def held_spans(scenario: Scenario, shrink_of: Callable[[Limit], float]) -> dict[Limit, Spans]:
    """Return when the task fixes all free coordinates that each limit depends on; of rates and soft limits never.

    Fixed ends that are inside a limit by twice the share by which it is reduced do not count.
    """
    function, limits, spans = scenario.limits.function, scenario.limits, dict[Limit, Spans]()
    fixed = _fixed(scenario)
    platform, carriers = at_ends(scenario)
    values = limits.along(platform, carriers, None, scenario.off_path(_both_ends(scenario), platform, carriers))
    patterns = (ca.DM(function.jac_sparsity(0, i), 1.0) for i in range(function.n_in()))
    *bodies, of_tensions, of_offset = (pattern.full() > 0 for pattern in patterns)
    for limit, place, its in zip(limits, limits.places, values, strict=True):
        if isinstance(limit, Rate) or limit.soft is not None:
            continue
        needed: set[_Coordinate] = {(None, int(i), 0) for i in np.flatnonzero(of_offset[place].any(axis=0))}
        for owner, body in zip((None, *range(len(bodies) - 1)), bodies, strict=True):
            for column in np.flatnonzero(body[place].any(axis=0)):
                needed |= _of_planner(scenario, owner, int(column) // 6, int(column) % 6)
        with_tensions = bool(of_tensions[place].any())
        its = limit.over(_both_ends(scenario), its)
        slack = np.minimum(its - limit.low, limit.high - its).min(axis=1)
        near = slack <= 2 * shrink_of(limit) * limit.scale
        spans[limit] = _held(scenario, fixed, needed, with_tensions, near | with_tensions | isinstance(limit, Angle))
    return spans


def held_wrench(scenario: Scenario, reserve: float) -> Spans:
    """Return when the task fixes the whole motion, and so the wrench, which needs tensions near their limits.

    A fixed end with tensions that are inside their limits by twice the `reserve` [N] does not count.
    """
    platform, carriers = at_ends(scenario)
    times, scale = _both_ends(scenario), scenario.robot.dof_mask * scenario.robot.wrench_scale
    A = scenario.dynamics.wrench_matrix(platform.pose, carriers.pose) * scale[:, None]
    w = scenario.required_wrench(times, platform, carriers, scenario.wind) * scale
    low, high = scenario.bounds_at(times)
    inside = solve_batch(A, w, low + 2 * reserve, high - 2 * reserve, low + 2 * reserve).feasible
    needed = [(*owner, order) for owner in scenario.owners() for order in range(3)]
    return _held(scenario, _fixed(scenario), needed, chooses=True, near=~inside)


def _fixed(scenario: Scenario) -> dict[int, set[tuple[int, int]]]:
    """Return columns and orders of the derivatives that the task fixes at the start (0) and at the end (-1)."""
    fixed: dict[int, set[tuple[int, int]]] = {0: set(), -1: set()}
    for value in fixed_values(scenario):
        fixed[value.end].add((value.column, value.order))
    return fixed


def _both_ends(scenario: Scenario) -> np.ndarray:
    return np.array([0.0, scenario.duration])


def at_ends(scenario: Scenario) -> tuple[Motion, Motion]:
    """Return the motions of platform and carriers at both ends, with what the task fixes there."""
    fixed, times = between_fixed_values(scenario) if scenario.count else None, _both_ends(scenario)
    if fixed is not None:
        # A motion is what its nodes say at the beginning of an interval; at its end it has what integration leaves.
        q, v, a, tensions = (part[[0, -1, -1]] for part in (fixed.q, fixed.v, fixed.a, fixed.tensions))
        fixed = Deviation(scenario.duration * np.arange(3.0), q, v, a, tensions)
    return scenario.motion(times, fixed)


def eased(held: Spans, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return the part of a tightening that holds from each `first` to each `last`, as shares of the duration, (n,)."""
    away = np.full(np.shape(first), EASE)
    for start, end in held:
        away = np.minimum(away, np.maximum(np.maximum(start - last, first - end), 0.0))
    return (away / EASE) ** 3


def _of_planner(scenario: Scenario, owner: int | None, order: int, coordinate: int) -> set[_Coordinate]:
    """Return the coordinates of the planner that one of a body's motion in {G} depends on."""
    if owner is None and scenario.relative:
        return {(body, i, k) for body in (None, 0) for i in range(6) for k in range(order + 1)}
    return {(owner, coordinate, order)}


def _held(
    scenario: Scenario,
    fixed: dict[int, set[tuple[int, int]]],
    needed: Iterable[_Coordinate],
    chooses: bool,
    near: np.ndarray,
) -> Spans:
    """Return when all coordinates that are `needed` are fixed, for a limit that `chooses` by tensions too, or not.

    `near` is which of both ends count, `fixed` what the task fixes there.
    """
    columns = {owner: column for column, owner in enumerate(scenario.owners())}
    free = {(columns[owner, i], order) for owner, i, order in needed if (owner, i) in columns}
    timed = scenario.duration_range is not None and any(order for *_, order in needed)
    if not (free or chooses or timed):
        return EVERYWHERE
    spans = [(float(share), float(share)) for end, share in ((0, 0.0), (-1, 1.0)) if near[end] and free <= fixed[end]]
    of_platform = {column for (owner, _), column in columns.items() if owner is None}
    if {column for column, _ in free} <= of_platform:
        lasts = scenario.duration
        spans += [(phase.start / lasts, phase.end / lasts) for phase in scenario.phases.all if phase.rests]
        if not any(k for _, k in free):
            spans += [(share, share) for share in (scenario.passes()[0] / lasts).tolist()]
    return tuple(spans)
