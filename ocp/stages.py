"""The stages of planning, up to the first that decides: `climb`.

1. ends and path (`infeasible_ends`): tasks that can be ruled out before planning;
2. durations (`durations`) and timing (`time_law`), if the duration alone is free: feasible durations;
3. a path past obstacles (`global_path`), where the usual guess exceeds a limit at rest: the next stages start from it;
4. when a motion in a tube should be where on its path, if the duration is a choice (`reference`);
5. easier programs to start the next from: linear distances from obstacles (`linear`); for teams more time and fewer
   steps (`homotopy`);
6. the nonlinear program (`program`), audited; where the audit reports violations, tightened or on a finer mesh
   (`refinement`);
7. the elastic program: the motion with the least missing wrench, for another start of the program or as the result.
"""

import time
from dataclasses import replace
from functools import partial

import numpy as np

from ..base.text import quantity
from .audits.audit import audit, other_tensions_exist, other_tensions_may_pass
from .audits.violation import cost, relative_violation
from .global_path.global_path import motion_past
from .nlp.rows import Mesh
from .plan import Plan
from .proofs.durations import Durations
from .proofs.infeasible_ends import infeasible_ends
from .proofs.too_little_power import too_little_power
from .search.feasible_changes import feasible_changes
from .search.homotopy import from_easier
from .search.largest_share import exceeds
from .search.reference import about_better_reference
from .search.refinement import refine
from .search.search import Search
from .search.time_law import BOUND, audit_of_law, has_own_law
from .tasks.deviation import Deviation
from .tasks.ends import between_fixed_values
from .tasks.task import MotionStatus
from .tasks.wind_set import WindDisc
from .timing.timed_task import ACCELERATIONS, SPEEDS

NO_SLACK = 1e-3  # of the weight: a motion with less missing at its nodes is a start for another try
PLACES = 201  # of a motion by its own time law
FALLING = {*SPEEDS, *ACCELERATIONS, "platform_turn", "cable_jerk"} - {"platform_lateral_acceleration"}  # with 1 / T^k
UNPROVEN = "no tensions exist in winds a little stronger than the task's; for the task's own winds this is not proven"


def climb(search: Search, start: Deviation | None, last: tuple[Mesh, Deviation] | None) -> Plan:
    """Plan stage after stage, from `start`, or else from the `last` feasible plan of the same task, if there is one."""
    scenario = search.scenario
    if scenario.is_fixed:
        return _fixed_motion(search)
    if (proven := _blocked(search)) is not None:
        return proven
    timed, own = _time_law(search) if scenario.count == 0 else (None, True)
    if timed is not None and not (own and timed.feasible):
        return timed
    if start is last is None:
        planned = about_better_reference(search, _free_motion)
    else:
        planned = (_again(search, *last) if start is None and last else None) or _free_motion(search, start)
    if timed is None or (planned.feasible and cost(planned) <= cost(timed)):
        return planned
    return replace(timed, build_s=search.build_s, solve_s=search.solve_s)


def _fixed_motion(search: Search) -> Plan:
    """Plan a task with free tensions only: each instant is a separate tension-distribution problem.

    If only limits on tension rates or on the forces at carriers are exceeded, the program searches for tensions
    that keep them. If anything other than the sum of squared tensions adds to the cost, such as an exceeded soft
    limit, it also searches for cheaper ones.
    """
    start = time.perf_counter()
    audit = search.audit_motion(search.scenario, None, known=search.known)
    spent = time.perf_counter() - start
    status, reason = MotionStatus.FEASIBLE if audit.passed else MotionStatus.INFEASIBLE, ""
    if not audit.passed and other_tensions_may_pass(search.scenario, audit):
        if proven := too_little_power(search.scenario):
            audit = replace(audit, excess=proven)
            _durations(search)
            offers = partial(feasible_changes, search, search.scenario, None, audit)
            return Plan(search.scenario, status, None, audit, build_s=0.0, solve_s=spent, offers=offers)
        chosen = _free_motion(search, None)
        if relative_violation(chosen.scenario, chosen.audit) < relative_violation(search.scenario, audit):
            return chosen
        status, reason = MotionStatus.NOT_FOUND, chosen.reason
    plan = Plan(search.scenario, status, None, audit, build_s=0.0, solve_s=spent, reason=reason)
    if audit.passed:
        weighed, of_tensions = search.scenario.task.objective, search.scenario.limits.of_tensions
        soft = any(excess.limit in of_tensions for excess in audit.soft_excess)
        alone = not (soft or weighed.own) and weighed.margin is weighed.tension_rate is None
        if alone or not other_tensions_exist(search.scenario, audit):
            return plan
        chosen = _free_motion(search, None)
        return chosen if chosen.feasible and cost(chosen) < cost(plan) else plan
    if isinstance(search.scenario.wind_set, WindDisc) and audit.certificate is None and not audit.excess:
        plan = replace(plan, status=MotionStatus.NOT_FOUND, reason=UNPROVEN)
    _durations(search)  # a stage of the report
    return replace(plan, offers=partial(feasible_changes, search, search.scenario, None, audit))


def _durations(search: Search) -> Durations | None:
    """Return the durations that the path allows; None if they are not known."""
    with search.stage("durations") as stage:
        left = search.timing.durations
        stage.message = "" if left is None else left.describe()
    return left


def _blocked(search: Search) -> Plan | None:
    """Return the proof that the task is infeasible, if its ends or its path show it; otherwise None."""
    span = search.scenario.duration_range
    slowest = search.scenario if span is None else search.scenario.lasting(span.max)
    with search.stage("ends and path") as stage:
        proof = infeasible_ends(slowest)
        stage.message = "" if proof is None else proof.describe()
    if proof is None:
        return None
    start = time.perf_counter()
    motion = between_fixed_values(slowest)
    audited = audit(slowest, motion, to_show=True)
    seconds = time.perf_counter() - start
    offers = partial(feasible_changes, search, slowest, motion, audited)
    return Plan(slowest, MotionStatus.INFEASIBLE, motion, proof.of(audited), 0.0, seconds, offers=offers)


def _time_law(search: Search) -> tuple[Plan | None, bool]:
    """Plan a motion with only the time law free; return also whether the path's own time law may be feasible.

    The plan is feasible, or proves that no time law is; otherwise it is None. Without `time` in the objective the
    fastest law is computed only if the path's own one is too fast or has no tensions in all durations; none is chosen
    for less power of the winches.
    """
    scenario, span = search.scenario, search.scenario.duration_range
    if span is None:
        return None, True
    left, slowest = _durations(search), scenario.lasting(span.max)
    own, alone = left is None or left.leave(span.min, span.max), has_own_law(scenario)
    chosen_by_time = scenario.task.objective.time is not None and not alone
    power = too_little_power(slowest, span.max / span.min) if own and left is not None and not chosen_by_time else []
    too_fast = own and scenario.stretches and exceeds(slowest, np.linspace(0.0, span.max, PLACES)).any()
    law, too_slow = None, False
    if chosen_by_time or not (alone or power or (own and not too_fast)):
        with search.stage("timing") as stage:
            fast, stage.message = search.timing.fastest
        law, least = None if fast is None else fast.law, span.min if own and not too_fast else 0.0
        if fast is not None and law is not None and fast.feasible and least <= fast.duration <= span.max:
            chosen = scenario.along(law.path.resting_until(span.min), max(fast.duration, span.min))
            known = audit_of_law(fast, chosen) if chosen.path is law.path else None
            audit = search.audit_motion(chosen, None, "audit with the fastest time law", known)
            return (Plan(chosen, MotionStatus.FEASIBLE, None, audit, 0.0, 0.0) if audit.passed else None), own
        too_slow = fast is not None and fast.feasible and BOUND * fast.duration > span.max
    none_other = alone or power or too_slow or (law is not None and law.certificate is not None)
    if not none_other or (own and not (power or too_fast)):
        return None, own
    # The slowest motion is the closest one if no law is fast enough, none passes some place, or the own is too fast.
    audit = search.audit_motion(slowest, None, f"audit, duration {quantity(span.max, 's')}")
    if own:
        excess = power or [each for each in audit.excess if each.limit in FALLING]
        audit = replace(audit, excess=excess, certificate=None)
    if audit.passed or (own and not audit.excess):
        return None, True
    offers = partial(feasible_changes, search, slowest, None, audit)
    return Plan(slowest, MotionStatus.INFEASIBLE, None, audit, 0.0, 0.0, offers=offers), own


def _free_motion(search: Search, start: Deviation | None) -> Plan:
    """Solve, audit and refine; if the program has no solution, search for the closest motion first."""
    scenario = search.scenario
    mesh = Mesh(scenario.task.steps)
    guessed = start is None and not search.knows(mesh)
    # The program alone gets past most places without tensions at rest, unless another formation is what they need.
    team = bool(scenario.loose)
    collides = shifted = False
    if guessed:
        start, collides, shifted = motion_past(search, balance=team)
    outcome = from_easier(search, mesh, start, guessed, shifted)
    if shifted and not outcome.success and search.seconds_left > 0:
        start = motion_past(search, balance=team, shifting=False).motion
        outcome = from_easier(search, mesh, start, guessed)
    if not outcome.success and guessed and not (team or collides) and search.seconds_left > 0:
        path = motion_past(search, balance=True).motion
        if path is not None:
            start, outcome = path, search.solve("nonlinear program", mesh, path)
    if not outcome.success and search.seconds_left > 0:
        closest = search.solve("elastic program", Mesh(mesh.steps, elastic=True), start)
        if closest.slack > NO_SLACK * scenario.robot.force_scale:
            search.audit(closest)
            return _closest(search, "no motion with feasible tensions was found that keeps every other limit")
        outcome = search.solve("nonlinear program", mesh, closest.deviation)
    return _closest(search, refine(search, outcome))


def _again(search: Search, mesh: Mesh, motion: Deviation) -> Plan | None:
    """Solve the program whose solution passed its audit before, from there; return the plan if it passes again."""
    own = search.has_solution(mesh)  # with its multipliers
    outcome = search.solve("nonlinear program", mesh, None if own else motion, clear=True)
    return search.best() if outcome.success and search.audit(outcome).passed else None


def _closest(search: Search, reason: str) -> Plan:
    """Return the best plan or a direct motion that is feasible, or else the best plan with its relaxations."""
    plan = search.best(reason)
    offers = partial(feasible_changes, search, plan.scenario, plan.deviation, plan.audit)
    return plan if plan.feasible else search.audit_direct() or replace(plan, offers=offers)
