"""Solve a program again while its audit reports violations: `refine`; plan other tasks with a part of the effort."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import product
from typing import TypeAlias

import numpy as np

from ..audits.audit import Audit
from ..audits.excess import TENSIONS
from ..global_path.global_path import motion_past
from ..limits.platform import PlatformSpeed
from ..nlp.near import has_places
from ..nlp.rows import Mesh
from ..nlp.solver import Outcome
from ..plan import Plan
from ..proofs.infeasible_ends import infeasible_ends
from ..tasks.deviation import Deviation
from ..tasks.scenario import Scenario
from ..tasks.task import MotionStatus
from .search import Search, ended

REFINEMENTS = 4  # each with twice the nodes, or four times as many, and a little more distance from the limits
MOST_STEPS = 1600
RESERVE = 1e-3  # of the weight, from the tension limits
LARGEST_RESERVE = 0.03  # of the weight: more would make what is possible impossible
SPARE = 2.0  # times a missing wrench: the distance from the tension limits that makes up for it on the same mesh
SHRINK = 2e-3  # of limits other than the tension limits
TIGHTENINGS = 3  # on the same mesh
LITTLE = 0.05  # of a limit: what a motion exceeds between nodes where the same mesh does
TIGHTENED = 1.1  # times what the audit reports, on the same mesh
LARGEST_SHARE = 0.2  # of a limit, for what one audit reports
DIGITS = 4  # of what is offered: reports print no more
PART = 0.8  # of the remaining effort, for one program
LEAST_EFFORT = 1e5  # [us]: less finds nothing
CONFIGURATIONS = 1_000, 1_500  # that are evaluated with each reserve for the start of one
LARGE, FEWEST = 600, 20  # free coordinates at all nodes of a mesh, and its steps

Shares: TypeAlias = tuple[tuple[str, str, float], ...]
"""Name of a limit, what it is about, and the share by which it is reduced (`Mesh.further`)."""


def refine(search: Search, outcome: Outcome) -> str:
    """Audit a solution, and solve again as long as the audit reports violations; return why it ends.

    Limits that are exceeded a little between the nodes are tightened by that on the same mesh, a few times. Else, and
    where equations are missed, which cannot be tightened, the mesh gets finer each time.
    """
    scenario, mesh = search.scenario, Mesh(search.scenario.task.steps, between=search.between)
    audit = search.audit(outcome)
    reserve, shrink = 0.0, 0.0
    for attempt in range(1, REFINEMENTS + 2):
        outcome, audit, mesh, possible = _tightened_again(search, outcome, audit, mesh)
        solved_once = outcome.success or mesh.further
        if attempt > REFINEMENTS or audit.passed or not solved_once or search.seconds_left <= 0:
            break
        # Between finer nodes less can happen; a little distance from the limits takes care of what still does. It falls
        # at least as the distance of the nodes does, and with it half of what was reduced before.
        missed = float(audit.violation.max()) / scenario.robot.force_scale
        reserve = min(reserve + RESERVE + missed, LARGEST_RESERVE)
        shrink = SHRINK * attempt if audit.excess else shrink
        further: Shares = ()
        if outcome.success and possible:  # else not again what had no solution
            halved = tuple((name, about, share / 2) for name, about, share in mesh.further)
            further = _tightened(scenario, audit, halved)
        between = tuple(sorted({*mesh.between, *_missed_between(scenario, audit)}))
        finer = _times_finer(scenario, audit)
        # Where carriers cannot follow the motion between the nodes. Wrenches that few cables miss are left to finer
        # meshes: with those, the shortest durations are closer to the least.
        equations = {limit.name for limit in scenario.limits if limit.is_equation}
        if finer > 1 and scenario.task.scheme is None and any(excess.limit in equations for excess in audit.excess):
            scenario, finer = search.take_scheme("hermite"), 1
        steps = min(finer * mesh.steps, MOST_STEPS)
        mesh = Mesh(steps, reserve * scenario.robot.force_scale, shrink, further, between)
        outcome = search.solve("nonlinear program", mesh, outcome.deviation, coarser=outcome.success)
        audit = search.audit(outcome)
    steps = mesh.steps
    if outcome.success:
        return f"the audit reports violations up to the finest mesh, {steps} steps"
    return f"nonlinear program of {steps} steps: {ended(outcome.message)}"


def _missed_between(scenario: Scenario, audit: Audit) -> set[str]:
    """Return what an audit reports that rows between the nodes keep: the platform's speed in {G}, and tensions.

    A motion that turns at its largest speed, as after a start with it, would turn faster on each finer mesh. A fast one
    changes from the largest to the least tension in one interval, however short.
    """
    names = {limit.name for limit in scenario.limits if isinstance(limit, PlatformSpeed) and limit.soft is None}
    names = set[str]() if scenario.relative else names & {excess.limit for excess in audit.excess}
    parabolas = len(scenario.scheme.inner) == 1 and not scenario.phases.all and scenario.wind_set is None
    return names | ({TENSIONS} if parabolas and _missed(audit) else set())


def _tightened_again(search: Search, outcome: Outcome, audit: Audit, mesh: Mesh) -> tuple[Outcome, Audit, Mesh, bool]:
    """Return a solution on the same mesh with limits that are tightened where the motion exceeds them a little.

    Then whether the last program had a solution.
    """
    scenario, little, possible = search.scenario, LITTLE, True
    for _ in range(TIGHTENINGS):
        beyond = _beyond(scenario, audit)
        if not (outcome.success and search.seconds_left > 0 and 0.0 < beyond <= little):
            break
        further, little = _tightened(scenario, audit, mesh.further, TIGHTENED), beyond / 2
        mesh = replace(mesh, reserve=mesh.reserve + SPARE * _missed(audit), further=further)
        search.tighten(mesh)
        guess = None if search.has_solution(mesh) else outcome.deviation
        again = search.solve("nonlinear program", mesh, guess, clear=True)
        if not (possible := again.success):
            break
        outcome, audit = again, search.audit(again)
    return outcome, audit, mesh, possible


def _times_finer(scenario: Scenario, audit: Audit) -> int:
    """Return how many times as many steps are next: four where half the step would still miss an equation."""
    missed = [
        limit.scale * limit.share_beyond(excess.value) / limit.tolerance
        for excess, limit in product(audit.excess, scenario.limits)
        if limit.is_equation and limit.name == excess.limit and limit.is_about(excess.about)
    ]
    halved = 2.0 ** (scenario.scheme.degree + 1)  # times less is missed between nodes half as far apart
    return 4 if max(missed, default=0.0) > halved else 2


def _beyond(scenario: Scenario, audit: Audit) -> float:
    """Return the largest share of a limit by which an audit reports it exceeded; inf if less of a limit is no help.

    A missing wrench is a share of the weight.
    """
    missed = _missed(audit) / scenario.robot.force_scale
    shares = [share for *_, share in _tightened(scenario, audit, ())]
    helps = missed <= RESERVE and all(shares) and len(shares) == len(audit.excess)
    return max([missed, *shares]) if helps else np.inf


def _missed(audit: Audit) -> float:
    """Return the largest missing wrench that an audit reports [N]."""
    missed = float(audit.violation.max())
    return missed if missed > audit.tolerance else 0.0


def _tightened(scenario: Scenario, audit: Audit, before: Shares, factor: float = 1.0) -> Shares:
    """Return the share by which each limit is reduced: as `before`, and by `factor` times what the audit reports.

    Limits that cannot be reduced are left out.
    """
    shares = {(name, about): share for name, about, share in before}
    for excess in audit.excess:
        for limit in scenario.limits:
            if limit.name == excess.limit and limit.is_about(excess.about) and limit.tightens:
                # All that a limit is about is reduced by the largest share so far.
                own = [share for name, about, share in before if name == limit.name and limit.is_about(about)]
                value = excess.value if excess.between is None else excess.between
                share = max(own, default=0.0) + factor * limit.share_beyond(value)
                shares[excess.limit, excess.about] = min(share, LARGEST_SHARE)
    return tuple((*key, share) for key, share in shares.items())


def planned(search: Search, scenario: Scenario, name: str, guess: Deviation | None = None) -> Plan | None:
    """Return a feasible plan of another scenario, whose audit is a stage with a `name`; None if none is found.

    Without free coordinates it is the motion itself, else the solution of the program, refined as for any task,
    unless the scenario is proven infeasible.
    """
    if not scenario.count and not _cut_short(search):
        audit = search.audit_motion(scenario, None, name)
        return Plan(scenario, MotionStatus.FEASIBLE, None, audit, 0.0, 0.0) if audit.passed else None
    if not scenario.count or infeasible_ends(scenario) is not None:
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

    Its programs and audits may take a part of the effort that is left for offers. None if too little is left, or if
    there is no solution. The mesh has fewer steps than a large task, since the refinement adds some.
    """
    if _cut_short(search):
        yield None
        return
    count, steps = max(scenario.count, 1), scenario.task.steps
    beside = Search(scenario, {}, search.progress, scenario.task.time_limit - search.solve_s)
    beside.most_effort = PART * (search.most_effort - search.effort)
    large = LARGE // 2 if has_places(scenario) else LARGE  # rows of regions make it twice as large
    mesh = Mesh(steps if scenario.phases.all else min(steps, max(large // count, FEWEST)))
    if guess is None and has_places(scenario):  # from a start that is clear the program takes few iterations
        guess = motion_past(beside, balance=bool(scenario.loose), most=CONFIGURATIONS).motion
    outcome = beside.solve("program of a relaxation", mesh, guess, clear=guess is not None)
    yield (beside, outcome) if outcome.success else None
    search.effort += beside.effort


def _cut_short(search: Search) -> bool:
    """Return whether too little effort is left for offers, which the search notes."""
    search.cut_short |= search.most_effort - search.effort < LEAST_EFFORT
    return search.cut_short


def rounded(value: float, up: bool) -> float:
    """Return a number of as many digits as reports print, on the side that keeps what it is for."""
    if not value:
        return value
    exponent = int(np.floor(np.log10(abs(value)))) - DIGITS + 1
    digits = (np.ceil if up else np.floor)(value / 10.0**exponent - (1e-9 if up else -1e-9))
    return float(f"{int(digits)}e{exponent}")
