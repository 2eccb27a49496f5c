"""Plan a motion inside the tension limits for a robot and a task, or report why none exists: `plan`.

`stages` has what the planner does, up to the first stage that decides.
"""

import os
from dataclasses import replace
from functools import partial
from typing import Any

from ..base.display import Displayed
from ..base.inputs import InputError, number
from ..models.files import AnyRobot, as_robot
from .nlp.rows import Mesh
from .nlp.solver import Progress, Solver, check_progress
from .nlp.waiting import heeding
from .plan import Plan
from .search.reference import deviation_from, with_its_reference
from .search.replanning import Replanner
from .search.search import Search
from .search.shortest_durations import Chosen, shortest_durations
from .search.stops_within import stopping_within
from .search.time_law import PathTiming
from .search.uncertain_robots import for_robots, judged
from .stages import climb
from .tasks.deviation import Deviation
from .tasks.initial import Initial
from .tasks.lay_out import Measured, lay_out
from .tasks.paths import AnyPath
from .tasks.scenario import Scenario
from .tasks.task import Task, read_task

LEAST_SHARE = 1e-9  # of robots that must keep their limits, or that need not


def plan(
    robot: AnyRobot,
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

    If only the duration is free, the planner also chooses the time law by the task's objective: the path's own time
    law, stretched, or the fastest one (`time_along`, if the extra `timing` is installed).

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        task: A `Task`, a mapping with its keys, or the path of a YAML file.
        progress: Called with (iteration, objective, infeasibility) while the nonlinear program is solved.
        start: Initial guess: a plan of the same robot for a similar task, or a path for the platform (or a mapping with
            its keys) in the frame of the task's path. Default: the planner's guess.
        initial: The measured state from which the motion starts, instead of the task's `initial`: an `Initial`, a
            mapping with its keys, or a `control.State`.
        robust: Fraction of all robots within the `uncertainty` of the robot file, such as 0.95, instead of the task's:
            to first order, this fraction has tensions inside their limits at all times of the plan. The planner
            iterates, with limits tightened by the tension spread of the previous plan.

    Returns:
        Plan: With status `feasible`; or `infeasible`, proven by the certificate or by a limit that every allowed motion
            exceeds; or `not-found`, with the certificate of the closest motion known, or with the limits that it
            exceeds. `Plan.stages` records the stages, `Plan.infeasible_spans` the times without tensions, and
            `Plan.relaxations` suggests feasible variations: a duration, or looser limits.

    Raises:
        InputError: If the task or the start is invalid or does not fit the robot.
    """
    with heeding():
        return Planner(robot, task, initial, robust).plan(progress, start)


class Planner(Displayed):
    """Planner of one task, which reuses its programs and the last solution.

    Args:
        robot: As for `plan`.
        task, initial, robust: As for `plan`.

    Raises:
        InputError: As `plan` does.
    """

    def __init__(
        self,
        robot: AnyRobot,
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
        self._given = self.scenario.task
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
        if chosen is not None:
            search.stages, search.known = [chosen.stage], chosen.audit
        with heeding():
            guess = None if start is None else deviation_from(self.scenario, start)
            plan = replace(climb(search, guess, self._last), stages=tuple(search.stages))
            plan = plan if self._chosen is None else self._chosen.judged(plan)
            self.scenario = search.scenario
            if plan.feasible and plan.deviation is not None and search.mesh is not None:
                self._last = search.mesh, plan.deviation
            if self._share is not None:
                task = plan.scenario.task if self._chosen is None else self._given  # with its ranges of durations
                plan = for_robots(plan, task, self._share, partial(self._plan_again, search))
            if (within := self.scenario.task.stop_within) is not None:
                again = partial(self._plan_again, search, timing=search.timing)
                plan = stopping_within(plan, self.scenario, within, again)
        self._search = None
        self._flown = plan if plan.feasible else None
        return plan

    def _plan_again(
        self, first: Search, scenario: Scenario, start: Deviation | None, timing: PathTiming | None = None
    ) -> Plan:
        """Plan another scenario in the remaining time of the first search; `timing` is the timing of the same path."""
        scenario, chosen = shortest_durations(scenario)
        self._search = search = Search(scenario, {}, first.progress, first.seconds_left, timing=timing)
        search.built = first.built
        if chosen is not None:
            search.stages, search.known = [chosen.stage], chosen.audit
        plan = replace(climb(search, start, None), stages=tuple(search.stages))
        return plan if chosen is None else chosen.judged(plan)

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
        otherwise with the tensions of the last plan. Time 0 of the new plan is `time` of the whole motion.

        Args:
            state: A `control.State`, or an `Initial` or a mapping with its keys.
            time: Time since the start of the motion of `plan` [s], not earlier than in the last successful call.
            settle: Time within which the tracking error decays [s], limited to the remaining time.
            progress: As for `plan`.

        Returns:
            Plan: The plan, with the status that `plan` would return. If it is not feasible, the next call continues
                from the previous feasible plan.

        Raises:
            InputError: If there is no feasible plan yet, if the task has phases, exact waypoints, `robust`,
                `stop_within`, or a path in the frame of a carrier or of kind return, or if an argument does not fit.
        """
        check_progress(progress)
        if self._flown is None:
            raise InputError("replan must be called after a feasible plan, got none")
        if isinstance(self._flown, Plan):
            self._flown = Replanner(self._flown, partial(climb, last=None))
        with heeding():
            self._search, guess = self._flown.search(state, time, settle, progress)
            plan = self._flown.plan(self._search, guess, time)
        self._search = None
        return plan
