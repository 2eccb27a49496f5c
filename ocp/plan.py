"""`plan`: from a robot and a task to a motion inside the tension limits, or to the reason why there is none."""

from __future__ import annotations

import os
import time
from typing import Any

from ..errors import InputError
from ..models import Robot
from .audit import Audit, at_rest, audit
from .program import build
from .result import Plan, PlanStatus
from .rows import Mesh
from .scenario import Deviation, Scenario, lay_out
from .solver import Outcome, Progress, Solver
from .task import Task, read_task

REFINEMENTS = 4  # each with twice the nodes and a little more distance from the limits
MOST_STEPS = 1600
RESERVE = 1e-3  # of the weight, from the tension limits
LARGEST_RESERVE = 0.03  # of the weight: more would make what is possible impossible
SHRINK = 2e-3  # of the carriers' speed and acceleration limits
NO_SLACK = 1e-6  # of the weight: a motion that misses less at its nodes is a start for another try


def plan(
    robot: Robot,
    task: Task | dict[str, Any] | str | os.PathLike[str],
    progress: Progress | None = None,
    start: Plan | None = None,
) -> Plan:
    """Plan a motion of platform and carriers that keeps every tension inside its limits.

    The platform follows the task's path, exactly or inside a tube; the carriers hold, move as given, or are free inside
    their limits. What the planner may choose it chooses by inverse-dynamics transcription and IPOPT
    (`program`). A plan is called feasible only by its audit on a dense grid (`audit`).

    Parameters
    ----------
    robot
        From `towline.models.load`.
    task
        A `Task`, a mapping with its keys, or the path of a YAML file.
    progress
        Called with (iteration, objective, infeasibility) while the nonlinear program is solved.
    start
        A plan of the same robot for a similar task, to start from; None: the planner makes its own guess.

    Returns
    -------
    Plan
        With status `feasible`; or `infeasible`, proven by the certificate, if the motion was fixed by the task; or
        `not-found`, with the certificate at the worst time of the closest motion that was found, or with the limits
        that it leaves.

    Raises
    ------
    InputError
        If the task is not valid or does not fit the robot; one line naming the field and the value.
    """
    return Planner(robot, task).plan(progress, start)


class Planner:
    """Plans one task, again if need be: programs and solvers are kept, and the last solution to start from.

    Parameters
    ----------
    robot, task
        As for `plan`.

    Raises
    ------
    InputError
        As `plan` does.
    """

    def __init__(self, robot: Robot, task: Task | dict[str, Any] | str | os.PathLike[str]):
        self.scenario = lay_out(robot, read_task(task))
        self._solvers: dict[Mesh, Solver] = {}

    def plan(self, progress: Progress | None = None, start: Plan | None = None) -> Plan:
        """Plan; from `start`, else from the last solution, else from a guess."""
        if self.scenario.is_fixed:
            return _fixed_motion(self.scenario)
        return _free_motion(_Search(self.scenario, self._solvers, progress), _start(self.scenario, start))


def _start(scenario: Scenario, start: Plan | None) -> Deviation | None:
    """What a plan to start from deviates by, stretched to this scenario's duration."""
    if start is None or start.deviation is None:
        return None
    theirs = start.deviation
    if start.scenario.owners() != scenario.owners() or theirs.tensions.shape[1] != scenario.robot.m:
        raise InputError(
            f"start: is a plan of {start.scenario.robot.name!r} for {start.scenario.task.name!r} with other "
            "coordinates free; accepted: one whose robot, tube and base leave the same coordinates free"
        )
    if scenario.duration_range is not None:
        return theirs
    stretch = scenario.duration / theirs.nodes[-1]
    return Deviation(theirs.nodes * stretch, theirs.q, theirs.v / stretch, theirs.a / stretch**2, theirs.tensions)


def _fixed_motion(scenario: Scenario) -> Plan:
    """Nothing is free but the tensions: each instant is a tension-distribution problem of its own."""
    start = time.perf_counter()
    seen = audit(scenario, None)
    status = PlanStatus.FEASIBLE if seen.passed else PlanStatus.INFEASIBLE
    return Plan(scenario, status, None, seen, build_s=0.0, solve_s=time.perf_counter() - start)


class _Search:
    """Solves one scenario's programs, one after the other, and keeps the time that it took."""

    def __init__(self, scenario: Scenario, solvers: dict[Mesh, Solver], progress: Progress | None):
        self.scenario, self._solvers, self._progress = scenario, solvers, progress
        self.build_s, self.solve_s = 0.0, 0.0
        self._iterates: list[tuple[int, float, float]] = []

    def _seen(self, iteration: int, objective: float, infeasibility: float) -> None:
        """Keep what an iteration came to, and tell whoever asked."""
        self._iterates.append((iteration, objective, infeasibility))
        if self._progress is not None:
            self._progress(iteration, objective, infeasibility)

    def solve(self, mesh: Mesh, guess: Deviation | None) -> Outcome:
        """Solve the program of `mesh` from `guess`; None: from its last solution, or from a guess of its own."""
        start = time.perf_counter()
        if mesh not in self._solvers:
            self._solvers[mesh] = Solver(build(self.scenario, mesh))
        solver = self._solvers[mesh]
        solver.prepare(guess)
        built = time.perf_counter()
        at = None if guess is None else guess.at(solver.program.shares * guess.nodes[-1])
        outcome = solver.solve(at, self._seen)
        self.build_s += built - start
        self.solve_s += time.perf_counter() - built
        return outcome

    def plan(self, status: PlanStatus, outcome: Outcome, seen: Audit) -> Plan:
        """What came of it."""
        told = (outcome.iterations, outcome.message)
        scenario = self.scenario.lasting(outcome.duration)
        rows = tuple(self._iterates)
        return Plan(scenario, status, outcome.deviation, seen, self.build_s, self.solve_s, *told, iterates=rows)

    def audit(self, outcome: Outcome) -> Audit:
        """What the audit says of it."""
        return audit(self.scenario.lasting(outcome.duration), outcome.deviation)


def _closest(search: _Search, closest: Outcome) -> Plan:
    """What the elastic program says: all is well after all, or there can be no plan, or none was found."""
    seen = search.audit(closest)
    if seen.passed:
        return search.plan(PlanStatus.FEASIBLE, closest, seen)
    if search.scenario.count == 0:
        proven = at_rest(search.scenario.lasting(closest.duration), seen)
        if proven is not None:
            return search.plan(PlanStatus.INFEASIBLE, closest, proven)
    return search.plan(PlanStatus.NOT_FOUND, closest, seen)


def _free_motion(search: _Search, start: Deviation | None) -> Plan:
    """Solve, audit, refine what the audit objects to; if there is no solution, look for the closest motion first."""
    scenario = search.scenario
    steps = scenario.task.steps
    outcome = search.solve(Mesh(steps), start)
    if not outcome.success:
        closest = search.solve(Mesh(steps, elastic=True), None)
        if closest.slack > NO_SLACK * scenario.robot.force_scale:
            return _closest(search, closest)
        outcome = search.solve(Mesh(steps), closest.deviation)
    reserve, shrink = 0.0, 0.0
    seen = search.audit(outcome)
    for attempt in range(1, REFINEMENTS + 1):
        if seen.passed or not outcome.success:
            break
        # Between finer nodes less can happen; a little distance from the limits takes care of what still does.
        steps = min(2 * steps, MOST_STEPS)
        missed = float(seen.violation.max()) / scenario.robot.force_scale
        reserve = min(reserve + RESERVE + missed, LARGEST_RESERVE)
        shrink = SHRINK * attempt if seen.excess else shrink
        outcome = search.solve(Mesh(steps, reserve * scenario.robot.force_scale, shrink), outcome.deviation)
        seen = search.audit(outcome)
    return search.plan(PlanStatus.FEASIBLE if seen.passed else PlanStatus.NOT_FOUND, outcome, seen)
