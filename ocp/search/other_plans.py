"""Plan other tasks than a search's own, with a part of the effort that is left for offers."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ..nlp.rows import Mesh
from ..nlp.solver import MOST_ITERATIONS, Outcome
from ..plan import Plan
from ..proofs.infeasible_ends import infeasible_ends
from ..tasks.deviation import Deviation
from ..tasks.scenario import Scenario
from ..tasks.status import MotionStatus
from .refinement import refine
from .search import Search

DIGITS = 4  # of what is offered: reports print no more
# Effort of all programs of offers, as iterations times free coordinates at their nodes: what the plan took, within
# these bounds, of a few seconds.
LEAST_EFFORT, MOST_EFFORT = 8e4, 1.2e5
PART = 0.6  # of the remaining effort, for one program
LEAST_ITERATIONS = 15  # fewer find nothing
LARGE, FEWEST = 600, 20  # free coordinates at all nodes of a mesh, and its steps


def planned(search: Search, scenario: Scenario, name: str, guess: Deviation | None = None) -> Plan | None:
    """Return a feasible plan of another scenario, whose audit is a stage with a `name`; None if none is found.

    Without free coordinates it is the motion itself, else the solution of the program, refined as for any task,
    unless the scenario is proven infeasible.
    """
    if not scenario.count:
        audit = search.audit_motion(scenario, None, name)
        return Plan(scenario, MotionStatus.FEASIBLE, None, audit, 0.0, 0.0) if audit.passed else None
    if infeasible_ends(scenario) is not None:
        return None
    with _solved_beside(search, scenario, guess) as found:
        if found is None:
            return None
        refine(*found)
        plan = found[0].best()
    return plan if plan.feasible else None


def solved(search: Search, scenario: Scenario, guess: Deviation | None) -> Outcome | None:
    """Return the solution of another scenario's program; None if there is none."""
    with _solved_beside(search, scenario, guess) as found:
        return found and found[1]


@contextmanager
def _solved_beside(
    search: Search, scenario: Scenario, guess: Deviation | None
) -> Iterator[tuple[Search, Outcome] | None]:
    """Yield the search for a motion of another scenario, in the time that the task's limit left, and its solution.

    Its programs may take a part of the iterations that are left for offers: with a limit in seconds, a busy machine
    would find other results. None if too few are left, so that the search for offers is cut short, or if there is no
    solution. The mesh has fewer steps than a large task, since the refinement adds some.
    """
    left = min(max(search.effort, LEAST_EFFORT), MOST_EFFORT) - search.offers_effort
    count, steps = max(scenario.count, 1), scenario.task.steps
    most = int(PART * left / (count * steps))
    if most < LEAST_ITERATIONS:
        search.cut_short = True
        yield None
        return
    left_s = scenario.task.time_limit - search.solve_s
    beside = Search(scenario, {}, search.progress, left_s, min(most, MOST_ITERATIONS))
    mesh = Mesh(steps if scenario.phases.all else min(steps, max(LARGE // count, FEWEST)))
    outcome = beside.solve("program of a relaxation", mesh, guess)
    yield (beside, outcome) if outcome.success else None
    search.offers_effort += beside.effort


def rounded(value: float, up: bool) -> float:
    """Return a number of as many digits as reports print, on the side that keeps what it is for."""
    if not value:
        return value
    exponent = int(np.floor(np.log10(abs(value)))) - DIGITS + 1
    digits = (np.ceil if up else np.floor)(value / 10.0**exponent - (1e-9 if up else -1e-9))
    return float(f"{int(digits)}e{exponent}")
