"""Plan a motion inside the tension limits for a robot and a task, or report why none exists: `plan`.

The planner works in stages and stops at the first that decides:

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

import os
import time
from dataclasses import replace
from functools import partial
from typing import Any

from ..base.display import Displayed
from ..base.errors import InputError
from ..base.inputs import number
from ..base.text import quantity
from ..models import Robot
from ..models.files import as_robot
from .audits.audit import Audit, audit, other_tensions_exist, other_tensions_may_pass
from .audits.violation import cost, relative_violation
from .global_path.space import Space
from .global_path.start import motion_past
from .nlp.rows import Mesh
from .nlp.solver import Progress, Solver, check_progress
from .nlp.waiting import heeding
from .plan import Plan
from .proofs.durations import Durations, durations
from .proofs.infeasible_ends import infeasible_ends
from .result import Relaxed
from .search.homotopy import from_easier
from .search.reference import about_better_reference, with_its_reference
from .search.refinement import refine
from .search.relaxations import near_fixed_motion
from .search.replanning import Replanner
from .search.search import Search
from .search.shortest_durations import Chosen, shortest_durations
from .search.start import deviation_from
from .search.stops_within import stopping_within
from .search.stronger_or_nearer import near_chosen_motion, stronger_or_nearer
from .search.time_law import BOUND, fastest
from .search.uncertain_robots import for_robots, judged
from .tasks.deviation import Deviation
from .tasks.ends import between_fixed_values
from .tasks.initial import Initial
from .tasks.lay_out import lay_out
from .tasks.measured import Measured
from .tasks.paths import AnyPath
from .tasks.scenario import Scenario
from .tasks.status import MotionStatus
from .tasks.task import Task, read_task

LEAST_SHARE = 1e-9  # of robots that must keep their limits, or that need not
NO_SLACK = 1e-3  # of the weight: a motion with less missing at its nodes is a start for another try


def plan(
    robot: Robot | str | os.PathLike[str],
    task: Task | dict[str, Any] | str | os.PathLike[str],
    progress: Progress | None = None,
    start: Plan | AnyPath | dict[str, Any] | None = None,
    initial: Initial | Measured | dict[str, Any] | None = None,
    robust: float | None = None,
) -> Plan:
    """Plan a motion of platform and carriers that keeps every tension inside its limits.

    The platform follows the task's path, exactly or inside a tube. The carriers hold, move as given, or are free inside
    their limits. Free quantities are chosen by inverse-dynamics transcription and IPOPT. Only the audit on a dense grid
    decides that a plan is feasible.

    If the duration alone is free, so is the time law along the path: the path's own time law, stretched, competes with
    the fastest one (`time_along`, if the extra `timing` is installed), and the task's objective decides.

    Parameters
    ----------
    robot
        A `Robot`, the name of one in the library, or the path of a robot file.
    task
        A `Task`, a mapping with its keys, or the path of a YAML file.
    progress
        Called with (iteration, objective, infeasibility) while the nonlinear program is solved.
    start
        Initial guess: a plan of the same robot for a similar task, or a path for the platform (or a mapping with its
        keys) in the frame of the task's path. Default: the planner's guess.
    initial
        The measured state from which the motion starts, instead of the task's `initial`: an `Initial`, a mapping with
        its keys, or a `control.State`.
    robust
        Fraction of the robots consistent with the robot's `uncertainty`, such as 0.95, instead of the task's: to first
        order, this fraction has tensions inside their limits at all times of the plan. The planner iterates, with
        limits tightened by the tension spread of the previous plan.

    Returns
    -------
    Plan
        With status `feasible`; or `infeasible` if no motion that the task allows is feasible, proven by the certificate
        or by a limit that every such motion exceeds; or `not-found`, with the certificate at the worst time of the
        closest motion known, or with the limits that it exceeds. `Plan.stages` records the stages,
        `Plan.infeasible_spans` the times without tensions, and `Plan.relaxations` suggests feasible variations: a
        duration, or looser limits.

    Raises
    ------
    InputError
        If the task or the start is invalid or does not fit the robot.
    """
    with heeding():
        return Planner(robot, task, initial, robust).plan(progress, start)


class Planner(Displayed):
    """Plan similar tasks repeatedly, reusing programs and the last solution.

    Parameters
    ----------
    robot
        As for `plan`.
    task, initial, robust
        As for `plan`.

    Raises
    ------
    InputError
        As `plan` does.
    """

    def __init__(
        self,
        robot: Robot | str | os.PathLike[str],
        task: Task | dict[str, Any] | str | os.PathLike[str],
        initial: Initial | Measured | dict[str, Any] | None = None,
        robust: float | None = None,
    ):
        read = read_task(task)
        if robust is not None:
            read = read.model_copy(update={"robust": number("robust", robust, LEAST_SHARE, 1 - LEAST_SHARE)})
        scenario = lay_out(as_robot(robot), read, initial)
        self._share = scenario.task.robust
        # The first plan counts the robot as exact.
        self.scenario = replace(scenario, task=scenario.task.model_copy(update={"robust": None}))
        self._solvers: dict[Mesh, Solver] = {}
        self._search: Search | None = None  # that has not ended
        self._last: tuple[Mesh, Deviation] | None = None  # of the last feasible plan
        self._chosen: Chosen | None = None  # the stage that made ranges of durations numbers
        self._flown: Plan | Replanner | None = None  # what `replan` continues from

    @property
    def interrupted(self) -> Plan | None:
        """Return the audited best attempt of an interrupted call of `plan`, or None.

        The attempt is the best motion of the solver that met all constraints at its nodes, or one that was audited
        before; `feasible` is the result of its audit. The audit runs on first access, so that the interrupt is not
        delayed.
        """
        search = self._search
        plan = None if search is None else search.best_of_interrupted()
        if search is None or plan is None:
            return plan
        plan = replace(plan, stages=tuple(search.stages))
        return plan if self._share is None else judged(plan, self.scenario.robot, self._share)

    def plan(self, progress: Progress | None = None, start: Plan | AnyPath | dict[str, Any] | None = None) -> Plan:
        """Plan the task, starting from `start`, the last solution or a guess.

        Raises `InputError` if `progress` is not a function, or `start` does not fit.
        """
        check_progress(progress)
        with heeding():
            self.scenario, chosen = shortest_durations(self.scenario)
            self._chosen = chosen or self._chosen
            self.scenario = with_its_reference(start, self.scenario)
        self._search = search = Search(self.scenario, self._solvers, progress)
        search.stages += [chosen.stage] if chosen else []
        with heeding():
            guess = None if start is None else deviation_from(self.scenario, start)
            plan = replace(_climb(search, guess, self._last), stages=tuple(search.stages))
            plan = plan if self._chosen is None else self._chosen.judged(plan)
            self.scenario = search.scenario
            if plan.feasible and plan.deviation is not None and search.mesh is not None:
                self._last = search.mesh, plan.deviation
            if self._share is not None:
                plan = for_robots(plan, self._share, partial(self._plan_again, search))
            if (within := self.scenario.task.stop_within) is not None:
                plan = stopping_within(plan, self.scenario, within, partial(self._plan_again, search))
        self._search = None
        self._flown = plan if plan.feasible else None
        return plan

    def _plan_again(self, first: Search, scenario: Scenario, start: Deviation | None) -> Plan:
        """Plan another scenario in the remaining time of the first search."""
        self._search = search = Search(scenario, {}, first.progress, first.seconds_left)
        return replace(_climb(search, start, None), stages=tuple(search.stages))

    def replan(
        self,
        state: Initial | Measured | dict[str, Any],
        time: float,
        settle: float = 1.0,
        progress: Progress | None = None,
    ) -> Plan:
        """Replan the remainder of the motion from a measured state; it ends at the same pose and time.

        The new plan starts with the measured pose and velocity of the platform, and of carriers that the planner moves.
        Its path is the remainder of the task's path plus the current tracking error, which decays to zero within
        `settle`. If the state contains tensions, the plan starts with them and the acceleration that they cause;
        otherwise with the acceleration of the last plan. Time 0 of the new plan is `time` of the whole motion.

        Parameters
        ----------
        state
            A `control.State`, or an `Initial` or a mapping with its keys.
        time
            Time since the start of the motion of `plan` [s], not earlier than in the last successful call.
        settle
            Time within which the tracking error decays [s], limited to the remaining time.
        progress
            As for `plan`.

        Returns
        -------
        Plan
            The plan, with the status that `plan` would return. If it is not feasible, the next call continues from the
            previous feasible plan.

        Raises
        ------
        InputError
            If there is no feasible plan yet, if the task has phases, exact waypoints or a path in the frame of a
            carrier, or if an argument does not fit.
        """
        check_progress(progress)
        if self._flown is None:
            raise InputError("replan must be called after a feasible plan, got none")
        if isinstance(self._flown, Plan):
            self._flown = Replanner(self._flown, partial(_climb, last=None))
        with heeding():
            self._search, guess = self._flown.search(state, time, settle, progress)
            plan = self._flown.plan(self._search, guess, time)
        self._search = None
        return plan


def _climb(search: Search, start: Deviation | None, last: tuple[Mesh, Deviation] | None) -> Plan:
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
    that keep them. If the objective weighs more than the sum of squared tensions, it also searches for cheaper
    ones.
    """
    start = time.perf_counter()
    audit = search.audit_motion(search.scenario, None)
    spent = time.perf_counter() - start
    status, reason = MotionStatus.FEASIBLE if audit.passed else MotionStatus.INFEASIBLE, ""
    if not audit.passed and other_tensions_may_pass(search.scenario, audit):
        chosen = _free_motion(search, None)
        if relative_violation(chosen.scenario, chosen.audit) < relative_violation(search.scenario, audit):
            return chosen
        status, reason = MotionStatus.NOT_FOUND, chosen.reason
    plan = Plan(search.scenario, status, None, audit, build_s=0.0, solve_s=spent, reason=reason)
    if audit.passed:
        weighed = search.scenario.task.objective
        if weighed.margin is weighed.tension_rate is None or not other_tensions_exist(search.scenario, audit):
            return plan
        chosen = _free_motion(search, None)
        return chosen if chosen.feasible and cost(chosen) < cost(plan) else plan
    left = _durations(search, search.scenario)
    return replace(plan, offers=partial(_offers, search, search.scenario, left, audit))


def _offers(search: Search, scenario: Scenario, left: Durations | None, audit: Audit) -> list[Relaxed]:
    """Return feasible variations of a task that fixes the motion, or else of where it ends and of the robot."""
    return near_fixed_motion(search, scenario, left, audit) or stronger_or_nearer(search, scenario, audit)


def _durations(search: Search, scenario: Scenario) -> Durations | None:
    """Return the durations that the path allows; None if they are not known."""
    with search.stage("durations") as stage:
        left = durations(scenario)
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
    near = partial(near_chosen_motion, search, slowest, motion, audited, slower_helps=proof.by_rates)
    offers = partial(stronger_or_nearer, search, slowest, audited) if proof.by_weight else near
    return Plan(slowest, MotionStatus.INFEASIBLE, motion, proof.of(audited), 0.0, seconds, offers=offers)


def _time_law(search: Search) -> tuple[Plan | None, bool]:
    """Plan a motion with only the time law free; return also whether the path's own time law may be feasible.

    The plan is feasible, or proves that no time law is; otherwise it is None.
    """
    scenario, span = search.scenario, search.scenario.duration_range
    if span is None:
        return None, True
    left = _durations(search, scenario)
    own = left is None or left.leave(span.min, span.max)
    if own and scenario.task.objective.time is None:
        return None, own
    with search.stage("timing") as stage:
        fast, stage.message = fastest(scenario)
    if fast is None or fast.law is None:
        return None, own
    if fast.feasible and span.min <= fast.duration <= span.max:
        chosen = scenario.along(fast.law.path, fast.duration)
        audit = search.audit_motion(chosen, None, "audit with the fastest time law")
        return (Plan(chosen, MotionStatus.FEASIBLE, None, audit, 0.0, 0.0) if audit.passed else None), own
    too_slow = fast.feasible and BOUND * fast.duration > span.max
    if own or not (too_slow or fast.law.certificate is not None):
        return None, own
    # No law is fast enough, or there is a place that no law passes. The slowest motion is the closest one.
    slowest = scenario.lasting(span.max)
    audit = search.audit_motion(slowest, None, f"audit, duration {quantity(span.max, 's')}")
    if audit.passed:
        return None, True
    offers = partial(near_fixed_motion, search, slowest, left, audit)
    return Plan(slowest, MotionStatus.INFEASIBLE, None, audit, 0.0, 0.0, offers=offers), own


def _free_motion(search: Search, start: Deviation | None) -> Plan:
    """Solve, audit and refine; if the program has no solution, search for the closest motion first."""
    scenario = search.scenario
    mesh = Mesh(scenario.task.steps)
    guessed = start is None and not search.knows(mesh)
    # The program alone gets past most places without tensions at rest, unless another formation is what they need.
    team = bool(Space(scenario).loose)
    collides = False
    if guessed:
        start, collides = motion_past(search, balance=team)
    outcome = from_easier(search, mesh, start, guessed)
    if not outcome.success and guessed and not (team or collides) and search.seconds_left > 0:
        path, _ = motion_past(search, balance=True)
        if path is not None:
            start, outcome = path, search.solve("nonlinear program", mesh, path)
    if not outcome.success and search.seconds_left > 0:
        closest = search.solve("elastic program", Mesh(mesh.steps, elastic=True), start)
        if closest.slack > NO_SLACK * scenario.robot.force_scale:
            search.audit(closest)
            short = quantity(closest.slack, "N")
            return _closest(search, f"the search ended at a motion that is short by {short}")
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
    offers = partial(near_chosen_motion, search, plan.scenario, plan.deviation, plan.audit)
    return plan if plan.feasible else search.audit_direct() or replace(plan, offers=offers)
