"""`plan`: from a robot and a task to a motion inside the tension limits, or to the reason why there is none."""

from __future__ import annotations

import os
import time
from typing import Any

import numpy as np

from ..models import Robot
from . import transcription
from .audit import RATE, Audit, audit, examine
from .result import Plan, PlanStatus
from .scenario import Deviation, Scenario, lay_out
from .task import Task, read_task
from .transcription import Progress

ATTEMPTS = 3  # each with more distance from the limits, for what happens between the nodes


def plan(robot: Robot, task: Task | dict[str, Any] | str | os.PathLike[str], progress: Progress | None = None) -> Plan:
    """Plan a motion of platform and carriers that keeps every tension inside its limits.

    The platform follows the task's path, exactly or inside a tube; the carriers hold, move as given, or are free inside
    their limits. What the planner may choose it chooses by inverse-dynamics transcription and IPOPT
    (`transcription`). A plan is called feasible only by its audit on a dense grid (`audit`).

    Parameters
    ----------
    robot
        From `towline.models.load`.
    task
        A `Task`, a mapping with its keys, or the path of a YAML file.
    progress
        Called with (iteration, objective, infeasibility) while the nonlinear program is solved.

    Returns
    -------
    Plan
        With status `feasible`; or `infeasible`, proven by the certificate, if the motion was fixed by the task; or
        `not-found`, with the certificate at the worst time of the closest motion that was found.

    Raises
    ------
    InputError
        If the task is not valid or does not fit the robot; one line naming the field and the value.
    """
    scenario = lay_out(robot, read_task(task))
    if scenario.count == 0:
        return _fixed_motion(scenario)
    return _free_motion(scenario, progress)


def _fixed_motion(scenario: Scenario) -> Plan:
    """Nothing is free but the tensions: each instant is a tension-distribution problem of its own."""
    start = time.perf_counter()
    nodes = np.linspace(0.0, scenario.duration, scenario.task.steps + 1)
    coarse = examine(scenario, None, nodes, scenario.task.steps / scenario.duration)
    seen = audit(scenario, None) if coarse.passed else _around_worst(scenario, None, coarse)
    status = PlanStatus.FEASIBLE if seen.passed else PlanStatus.INFEASIBLE
    return Plan(scenario, status, None, seen, build_s=0.0, solve_s=time.perf_counter() - start)


def _free_motion(scenario: Scenario, progress: Progress | None) -> Plan:
    reserve, build_s, solve_s = 0.0, 0.0, 0.0
    for _ in range(ATTEMPTS):
        start = time.perf_counter()
        program = transcription.build(scenario, reserve)
        guess = transcription.initial_guess(scenario, program.nodes)
        built = time.perf_counter()
        outcome = transcription.solve(program, guess, progress)
        build_s += built - start
        solve_s += time.perf_counter() - built
        if not outcome.success:
            break
        seen = audit(scenario, outcome.deviation)
        if seen.passed:
            iterations, message = outcome.iterations, outcome.message
            return Plan(scenario, PlanStatus.FEASIBLE, outcome.deviation, seen, build_s, solve_s, iterations, message)
        reserve = 2 * (reserve + float(seen.violation.max()))
    return _closest_motion(scenario, progress, build_s, solve_s)


def _closest_motion(scenario: Scenario, progress: Progress | None, build_s: float, solve_s: float) -> Plan:
    """No plan was found: the motion that misses the least wrench, and the certificate at its worst time."""
    start = time.perf_counter()
    program = transcription.build(scenario, elastic=True)
    built = time.perf_counter()
    outcome = transcription.solve(program, transcription.initial_guess(scenario, program.nodes), progress)
    build_s, solve_s = build_s + built - start, solve_s + time.perf_counter() - built
    deviation: Deviation = outcome.deviation
    coarse = examine(scenario, deviation, program.nodes, scenario.task.steps / scenario.duration)
    seen = audit(scenario, deviation) if coarse.violation.max() <= coarse.tolerance else coarse
    if not seen.passed and seen is coarse:
        seen = _around_worst(scenario, deviation, coarse)
    status = PlanStatus.FEASIBLE if seen.passed else PlanStatus.NOT_FOUND
    return Plan(scenario, status, deviation, seen, build_s, solve_s, outcome.iterations, outcome.message)


def _around_worst(scenario: Scenario, deviation: Deviation | None, coarse: Audit) -> Audit:
    """The coarse audit with the neighbourhood of its worst time at the dense rate: where the certificate is wanted."""
    step = coarse.times[1] - coarse.times[0]
    around = coarse.times[coarse.worst] + np.arange(-step, step, 1 / RATE)
    inside = around[(around >= 0) & (around <= scenario.duration)]
    return examine(scenario, deviation, np.union1d(coarse.times, inside), RATE)
