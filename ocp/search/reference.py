"""Choose when the platform should be where on its path, and turn plans or paths into a start of the planner.

A motion in a tube deviates from a reference, the path with a time law. That of the task has smooth legs of given shares
of the duration, from which a tube of a few centimetres allows no fast motion. Better ones are the fastest time law,
smoothed, or legs with a duration each, as a program of few steps finds them. The reference is taken whose program of
few steps has the least objective.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from ...base.inputs import InputError, shown
from ...base.text import quantity, quantity_row
from ...models.parsing import validate
from ...models.part import Part
from ..audits.violation import cost
from ..nlp.grid import Grid
from ..nlp.guess import initial_guess
from ..nlp.rows import MANY, Mesh
from ..nlp.solver import Outcome
from ..plan import Plan
from ..tasks.deviation import Deviation
from ..tasks.ends import platform_ends
from ..tasks.paths import AnyPath, LinePath, PathBase, RestPath, TimedPath, WaypointPath
from ..tasks.scenario import ATTITUDE, Scenario
from ..tasks.scheme import LINEAR
from ..tasks.task import MotionStatus
from ..timing.fastest_law import FastestLaw
from .search import Search
from .time_law import fastest

STEPS, LEAST_STEPS, FEW = 7, 4, 28  # of each leg; of all
WINDOW = 3.0  # steps, over which the fastest law is smoothed
ROUNDING = 1e-9  # of the duration
FASTER = 0.9  # of the objective: less about the fastest law is enough
GAIN = 0.015  # of the objective: of less, finer steps may leave nothing


class _Candidate(NamedTuple):
    """A reference, and the optimum about it in a program of few steps."""

    path: AnyPath
    optimum: Outcome
    law: Plan | None = None  # the fastest, if it is that


def about_better_reference(search: Search, free_motion: Callable[[Search, Deviation | None], Plan]) -> Plan:
    """Plan a motion about the best reference by `free_motion(search, start)`.

    If the plan has a larger objective than the program of few steps about the task's own reference, the task is planned
    about that, too. So is the fastest law, if it starts and ends as the task requires. The best plan is returned.
    """
    scenario = search.scenario
    better, before = _better(search) if _leaves_times(scenario) else (None, np.inf)
    if better is None:
        return free_motion(search, None)
    search.take(taken := scenario.along(better.path, scenario.duration))
    planned = free_motion(search, better.optimum.deviation)
    if not (planned.feasible and _objective(planned) <= before):
        search.take(scenario)
        own = free_motion(search, None)
        if own.feasible and not (planned.feasible and _objective(planned) <= _objective(own)):
            planned = own
        else:
            search.take(taken)
    if better.law is not None and platform_ends(scenario.task) in ("exact", "free"):
        law = scenario.along(better.law.scenario.path, better.law.duration)
        audited = search.audit_motion(law, None, "audit with the fastest time law")
        exact = replace(planned, scenario=law, status=MotionStatus.FEASIBLE, deviation=None, audit=audited, reason="")
        if audited.passed and not (planned.feasible and _objective(planned) <= cost(exact)):
            return replace(exact, objective=None)
    return planned


def _objective(plan: Plan) -> float:
    return np.inf if plan.objective is None else plan.objective


def _better(search: Search) -> tuple[_Candidate | None, float]:
    """Return the best reference, None for the task's own, and the objective about the task's own."""
    scenario = search.scenario
    legs = len(scenario.path.points) - 1 if isinstance(scenario.path, WaypointPath) else 1
    mesh = Mesh(min(max(STEPS * legs, FEW), scenario.task.steps))
    coarse = scenario
    if scenario.scheme != LINEAR:
        coarse = replace(scenario, task=scenario.task.model_copy(update={"scheme": LINEAR.name}))
    with search.stage("reference") as stage:
        own = _solved(search, mesh, coarse, None)
        before = np.inf if own is None else own.objective
        found = [_fastest(search, coarse, mesh)]
        if legs > 1 and own is not None and (found[0] is None or found[0].optimum.objective > FASTER * before):
            found.append(_passing(search, coarse, mesh, own))
        best = min(filter(None, found), key=lambda each: each.optimum.objective, default=None)
        if best is None or best.optimum.objective > before:
            return None, before
        if isinstance(best.path, TimedPath):
            stage.message = f"the fastest time law, smoothed over {quantity(best.path.smoothing or 0.0, 's', 3)}"
        else:
            times = best.path.stations(best.optimum.duration).times[1:-1]
            stage.message = f"points passed at {quantity_row(times, 's', 3)}"
    return best, before


def with_its_reference(start: object, scenario: Scenario) -> Scenario:
    """Return the scenario with the reference of a plan for the same path."""
    its = start.scenario if isinstance(start, Plan) and start.deviation is not None else None
    same = its is not None and its.path.stretches and its.task.path == scenario.task.path
    return replace(scenario, path=its.path) if its is not None and same else scenario


def _leaves_times(scenario: Scenario) -> bool:
    """Return whether the planner may choose when the platform is where on its path, and enough steps show it."""
    path, still = scenario.path, all(isinstance(other, RestPath) for other in scenario.carrier_paths.values())
    tube = scenario.task.tube
    points = isinstance(path, WaypointPath) and path.shares is None
    # Else the path is only a guess.
    follows = np.isfinite(tube.radius) or (tube.waypoints == "exact" and points)
    legs = len(path.points) - 1 if isinstance(path, WaypointPath) else 1
    few = scenario.count <= MANY and scenario.task.steps >= LEAST_STEPS * legs
    chosen = follows and path.stretches and scenario.duration_range is not None and bool(scenario.platform_free)
    return chosen and still and few and not scenario.phases.all and (points or isinstance(path, LinePath))


def _fastest(search: Search, scenario: Scenario, mesh: Mesh) -> _Candidate | None:
    """Return the path with the fastest law, smoothed."""
    path, task = scenario.path, scenario.task
    # The jerk of a smoothed law jumps between nodes, where the program's jerk cannot make up for it.
    if task.objective.time is None or task.limits.cable_jerk is not None:
        return None
    if isinstance(path, WaypointPath):
        if path.shape == "spline" and task.tube.waypoints == "exact":
            return None
        # A mean over a corner that is only rounded would pass it at a speed that it does not have.
        path = path.model_copy(update={"blend": 0.0} if path.shape == "legs" else {})
    law, _ = fastest(replace(scenario, task=task.model_copy(update={"path": path})))
    if law is None or law.law is None or not law.feasible:
        return None
    window = WINDOW * law.duration / task.steps
    smoothed = TimedPath.model_validate(dict(law.law.path) | {"smoothing": window})
    optimum = _solved(search, mesh, scenario.along(smoothed, smoothed.least), None)
    return None if optimum is None else _Candidate(smoothed, optimum, law)


def _passing(search: Search, scenario: Scenario, mesh: Mesh, before: Outcome) -> _Candidate | None:
    """Return the path with better shares of the duration for its legs, if there are some."""
    path = scenario.path
    assert isinstance(path, WaypointPath)
    shares = path.knots(before.duration) / before.duration
    legs = replace(scenario.lasting(before.duration), passing=True)
    own = Grid.of(legs, mesh.steps).shares
    free = _solved(search, mesh, legs, before.deviation)
    if free is None:
        return None
    shares = free.deviation.nodes[np.searchsorted(own, shares - ROUNDING)] / free.duration
    found = path.model_copy(update={"shares": tuple(shares.tolist())})
    better = scenario.along(found, free.duration)
    after = _solved(search, mesh, better, _moved(legs, free, own * legs.duration, better))
    gains = after is not None and after.objective <= before.objective - GAIN * abs(before.objective)
    return _Candidate(found, after) if after is not None and gains else None


def _solved(search: Search, mesh: Mesh, scenario: Scenario, guess: Deviation | None) -> Outcome | None:
    """Return the optimum of a scenario on the mesh; None if there is none."""
    its = Search(scenario, {}, search.progress, search.seconds_left)
    its.built = search.built
    outcome = its.solve("reference", mesh, guess, clear=guess is not None)
    search.build_s, search.solve_s = search.build_s + its.build_s, search.solve_s + its.solve_s
    return outcome if outcome.success else None


def _moved(scenario: Scenario, its: Outcome, nominal: np.ndarray, other: Scenario) -> Deviation:
    """Return the same motion about the references of another scenario.

    `nominal` are the times at which the references of the first one are where they are at the nodes, (k,) [s].
    """
    before, nodes = its.deviation, its.deviation.nodes
    rate = np.diff(nominal) / np.diff(nodes)
    theirs = scenario.references(nominal)[0].timed(np.append(rate, rate[-1]), np.zeros(len(nodes)))
    parts = zip((before.q, before.v, before.a), theirs, other.references(nodes)[0], strict=True)
    q, v, a = (value + (at - reference) @ scenario.spread(None) for value, at, reference in parts)
    angles = [column for column, (owner, i) in enumerate(scenario.owners()) if owner is None and i in ATTITUDE]
    q[:, angles] -= 2 * np.pi * np.round(q[:, angles] / (2 * np.pi))
    return replace(before, q=q, v=v, a=a)


class _Start(Part):
    """A path that stands alone, checked as a task's is."""

    start: AnyPath = Field(description="for the platform to start from")


def deviation_from(scenario: Scenario, start: Plan | AnyPath | dict[str, Any]) -> Deviation | None:
    """Return the deviation of a start from the references of `scenario`; None if the task fixes the motion.

    Raises `InputError` if the start is not one of the accepted types, or does not fit the scenario.
    """
    if isinstance(start, Plan):
        return _of_plan(scenario, start)
    if isinstance(start, dict):
        start = validate({"start": start}, _Start, "plan").start
    if not isinstance(start, PathBase):
        raise InputError(f"start must be a Plan, a path or a mapping with its keys, got {shown(start)}")
    return _along(scenario, start, {}, start.natural_duration or scenario.duration)


def _of_plan(scenario: Scenario, start: Plan) -> Deviation | None:
    """Return a plan's own deviation, stretched to this scenario's duration."""
    if start.deviation is None:
        return None if start.law is None else _of_law(scenario, start.law)
    theirs = start.deviation
    if start.scenario.owners() != scenario.owners() or theirs.tensions.shape[1] != scenario.robot.m:
        raise InputError(
            "start must be a plan whose robot, tube and base leave the same coordinates free, got one of "
            f"{start.scenario.robot.name!r} for {start.scenario.task.name!r}"
        )
    return _lasting(scenario, theirs)


def _of_law(scenario: Scenario, law: FastestLaw) -> Deviation | None:
    robot = law.parametrised.robot
    if not law.exists:
        raise InputError("start must be a plan with a time law, got one of time_along without")
    if robot.name != scenario.robot.name or robot.m != scenario.robot.m:
        raise InputError(f"start must be a plan of robot {scenario.robot.name!r}, got one of {robot.name!r}")
    carriers: dict[int, AnyPath] = {
        index: path for index, path in law.carrier_paths.items() if not isinstance(path, RestPath)
    }
    return _along(scenario, law.path, carriers, law.path.natural_duration or scenario.duration)


def _along(scenario: Scenario, path: AnyPath, carriers: dict[int, AnyPath], seconds: float) -> Deviation | None:
    """Return the deviation of a platform on `path` and of carriers on theirs, or where the planner guesses them."""
    if path.frame != scenario.path.frame:
        raise InputError(f"start.frame must be {scenario.path.frame!r}, as in the task's path, got {path.frame!r}")
    if scenario.count == 0:
        return None
    nodes = np.linspace(0.0, seconds, scenario.task.steps + 1)
    there = scenario.along(path, seconds)
    about = initial_guess(there, nodes)
    mine, bases = scenario.lasting(seconds).references(nodes)
    given = [owner is None or owner in carriers for owner, _ in scenario.owners()]
    theirs = [carriers[i].at(nodes, seconds) if i in carriers else base for i, base in enumerate(bases)]
    values = []
    for k, guessed in enumerate((about.q, about.v, about.a)):
        off = np.stack([its[k] - base[k] for its, base in zip(theirs, bases, strict=True)], axis=1)
        values.append(np.where(given, scenario.free_of(there.references(nodes)[0][k] - mine[k], off), guessed))
    q, v, a = values
    return _lasting(scenario, Deviation(nodes, q, v, a, about.tensions))


def _lasting(scenario: Scenario, theirs: Deviation) -> Deviation:
    """Return the deviation stretched to the scenario's duration, or if that is open, to its own inside the range."""
    seconds, span = scenario.duration, scenario.duration_range
    if span is not None:
        seconds = float(np.clip(theirs.nodes[-1], span.min, span.max))
    return theirs.stretched(seconds / theirs.nodes[-1])
