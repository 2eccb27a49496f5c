"""Choose when a motion in a tube passes the points of its path, if its duration is a choice: `passing_times`.

A path through points passes each after a given share of the duration. Here each leg has a duration of its own, in a
program of few steps. The shares that result are taken if a program with them is better than one with the path's own.
"""

from dataclasses import replace

import numpy as np

from ...base.text import quantity_row
from ..nlp.grid import Grid
from ..nlp.rows import MANY, Mesh
from ..nlp.solver import Outcome
from ..plan import Plan
from ..tasks.deviation import Deviation
from ..tasks.paths import RestPath, WaypointPath
from ..tasks.scenario import ATTITUDE, Scenario
from .search import Search

STEPS, LEAST_STEPS = 7, 4  # of each leg
ROUNDING = 1e-9  # of the duration
GAIN = 0.015  # of the objective: of less, finer steps may leave nothing


def passing_times(search: Search) -> Deviation | None:
    """Give the search the path with better shares of the duration, and return a motion to start from.

    Returns None, and leaves the search as it is, if the task gives the times or no better ones are found.
    """
    scenario, path = search.scenario, search.scenario.path
    if not (isinstance(path, WaypointPath) and _leaves_times(scenario, path)):
        return None
    mesh = Mesh(min(STEPS * (len(path.points) - 1), scenario.task.steps))
    coarse = replace(scenario, task=scenario.task.model_copy(update={"scheme": "linear"}))
    with search.stage("passing times") as stage:
        before = _solved(search, mesh, coarse, None)
        if before is None:
            return None
        shares = path.knots(before.duration) / before.duration
        legs = replace(coarse.lasting(before.duration), passing=True)
        own = Grid.of(legs, mesh.steps).shares
        free = _solved(search, mesh, legs, before.deviation)
        if free is None:
            return None
        shares = free.deviation.nodes[np.searchsorted(own, shares - ROUNDING)] / free.duration
        found = path.model_copy(update={"shares": tuple(shares.tolist())})
        better = coarse.along(found, free.duration)
        after = _solved(search, mesh, better, _moved(legs, free, own * legs.duration, better))
        if after is None or after.objective > before.objective - GAIN * abs(before.objective):
            return None
        stage.message = f"points passed at {quantity_row(shares[1:-1] * after.duration, 's', 3)}"
    search.take(scenario.along(found, scenario.duration))
    return after.deviation


def as_timed_by(start: object, scenario: Scenario) -> Scenario:
    """Return the scenario with the path, and so with the shares of the duration, of a plan for the same path."""
    its = start.scenario if isinstance(start, Plan) else None
    same = its is not None and isinstance(its.path, WaypointPath) and its.task.path == scenario.task.path
    return replace(scenario, path=its.path) if its is not None and same else scenario


def _leaves_times(scenario: Scenario, path: WaypointPath) -> bool:
    """Return whether the planner may choose when the platform passes the inner points, and enough steps show it."""
    legs, still = len(path.points) - 1, all(isinstance(other, RestPath) for other in scenario.carrier_paths.values())
    tube = scenario.task.tube
    passes = np.isfinite(tube.radius) or tube.waypoints == "exact"  # else the path is only a guess
    own = passes and path.stretches and path.shares is None and scenario.duration_range is not None
    few = scenario.count <= MANY and scenario.task.steps >= LEAST_STEPS * legs
    return own and legs > 1 and still and few and bool(scenario.platform_free) and not scenario.phases.all


def _solved(search: Search, mesh: Mesh, scenario: Scenario, guess: Deviation | None) -> Outcome | None:
    """Return the optimum of a scenario on the mesh; None if there is none."""
    its = Search(scenario, {}, search.progress, search.seconds_left)
    outcome = its.solve("passing times", mesh, guess, clear=guess is not None)
    search.build_s, search.solve_s = search.build_s + its.build_s, search.solve_s + its.solve_s
    return outcome if outcome.success else None


def _moved(scenario: Scenario, its: Outcome, nominal: np.ndarray, other: Scenario) -> Deviation:
    """Return the same motion about the references of another scenario.

    `nominal` are the times at which the references of the first one are where they are at the nodes, (k,) [s].
    """
    nodes, values = its.deviation.nodes, [part.copy() for part in (its.deviation.q, its.deviation.v, its.deviation.a)]
    rate = np.diff(nominal) / np.diff(nodes)
    theirs = scenario.references(nominal)[0].timed(np.append(rate, rate[-1]), np.zeros(len(nodes)))
    mine = other.references(nodes)[0]
    for column, (owner, coordinate) in enumerate(scenario.owners()):
        for value, at, reference in zip(values, theirs, mine, strict=True):
            if owner is None:
                value[:, column] += (at - reference)[:, coordinate]
        if owner is None and coordinate in ATTITUDE:
            values[0][:, column] -= 2 * np.pi * np.round(values[0][:, column] / (2 * np.pi))
    q, v, a = values
    return replace(its.deviation, q=q, v=v, a=a)
