"""Replan the remainder of a motion from measured states: `Replanner`."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ...base.errors import InputError
from ...base.inputs import number
from ..nlp.rows import Mesh
from ..nlp.solver import Progress, Solver
from ..plan import Plan
from ..tasks.deviation import Deviation
from ..tasks.initial import check_ends
from ..tasks.measured import initial_of
from ..tasks.paths import ReturnPath
from ..tasks.scenario import Scenario
from .remaining_task import final_of, remainder
from .search import Search

LEAST = 1e-3  # [s], of what is left
RESERVE = 1e-4  # of the weight, from the tension limits: between nodes motions need some 1e-5


class Replanner:
    """Replan the remainder of a motion.

    One program with parameters serves all calls: references, start and length change, and each starts from the last
    solution and its multipliers. `first` is the plan of the whole motion, and `climb` plans from scratch whenever the
    program with parameters does not lead to a plan.

    Raises `InputError` if the remainder of its task cannot be planned.
    """

    def __init__(self, first: Plan, climb: Callable[[Search, Deviation | None], Plan]):
        _check(first.scenario)
        self._whole, self._climb = first.scenario, climb
        self._last, self._begun = first, 0.0
        self._final = final_of(first)
        self._solvers: dict[Mesh, Solver] = {}

    def search(self, state: Any, time: Any, settle: Any, progress: Progress | None) -> tuple[Search, Deviation | None]:
        """Return the search for the remainder of the motion from `time` [s] on, and a guess.

        Raises `InputError` if an argument does not fit.
        """
        at = number("time", time, self._begun, self._whole.duration - LEAST)
        return_s = number("settle", settle, LEAST, 1e6)
        initial = initial_of(self._whole, state, at, "state")
        check_ends(self._whole.robot, initial, None, "world", "replan")
        left, guess = remainder(self._whole, self._final, self._last, self._begun, at, initial, return_s)
        return Search(left, self._solvers, progress), guess

    def plan(self, search: Search, guess: Deviation | None, time: float) -> Plan:
        """Return the plan of a search; the next rest is that of this plan if it is feasible."""
        plan = self._by_last_solution(search, guess)
        if plan is None:
            anew = Search(search.scenario, {}, search.progress, search.seconds_left)
            plan = self._climb(anew, guess)
            search.stages += anew.stages
        plan = replace(plan, stages=tuple(search.stages))
        if plan.feasible:
            self._last, self._begun = plan, float(time)
        return plan

    def _by_last_solution(self, search: Search, guess: Deviation | None) -> Plan | None:
        """Plan with the program that has parameters; None if that is not possible, or leads to none."""
        scenario, mesh = search.scenario, Mesh(search.scenario.task.steps, RESERVE * search.scenario.robot.force_scale)
        if guess is None or scenario.scheme.smooth:
            return None
        outcome = search.solve_again(mesh, guess)
        return search.best() if outcome.success and search.audit(outcome).passed else None


def _check(scenario: Scenario) -> None:
    """Refuse motions whose rest cannot be planned."""
    task = scenario.task
    where = f"task {task.name!r}"
    if scenario.phases.all:
        raise InputError(f"{where}: phases must be left out to replan, got {len(scenario.phases.all)}")
    if task.robust is not None:
        raise InputError(f"{where}: robust must be left out to replan, got {task.robust:g}")
    if task.stop_within is not None:
        raise InputError(f"{where}: stop_within must be left out to replan, got {task.stop_within:g} s")
    if scenario.relative:
        raise InputError(f"{where}: path.frame must be world to replan, got {scenario.path.frame!r}")
    if task.tube.waypoints == "exact":
        raise InputError(f"{where}: tube.waypoints must be free to replan, got exact")
    if isinstance(scenario.path, ReturnPath):
        raise InputError(f"{where}: path must be one that is followed from its beginning, got one of kind return")
