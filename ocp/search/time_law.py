"""Compute the fastest time law along a task's path, as a stage of planning: `fastest`.

Where the path is followed exactly from rest to rest, `time_along` computes the least time of all time laws: a shorter
duration is impossible, and its law is a plan if it keeps the task's other limits too. Its minimum is found on a grid:
it differs from the true one by the grid's interval, some tenths of a per cent, so that `BOUND` of it is proven.
"""

from functools import cached_property

from ...base.errors import InputError, SolverError
from ...base.text import quantity
from ..audits.audit import Audit
from ..plan import Plan
from ..proofs.durations import Durations, durations
from ..tasks.paths import LinePath, RestPath, WaypointPath
from ..tasks.scenario import Scenario
from ..tasks.task import Tube
from ..tasks.task_limits import TaskLimits
from ..timing.time_along import time_along
from ..timing.timed_task import WITHOUT_POWER

BOUND = 0.99  # of the fastest law's time on its grid: no law is faster than this


class PathTiming:
    """Durations and time laws that the path of a scenario allows, computed once for all durations."""

    def __init__(self, scenario: Scenario):
        self._scenario = scenario

    @cached_property
    def durations(self) -> Durations | None:
        """Return the durations that the path allows with its own time law; None if they are not known."""
        return durations(self._scenario)

    @cached_property
    def fastest(self) -> tuple[Plan | None, str]:
        """Return the fastest law along the path, or None, and the message."""
        return fastest(self._scenario)


def fastest(scenario: Scenario) -> tuple[Plan | None, str]:
    """Return the fastest law along the path of a scenario whose duration alone is free, or None, and the message.

    `stop_within`, powers of winches, whose law is a local optimum, and limits that `time_along` does not know are left
    out: its time is a lower bound even so.
    """
    task = scenario.task
    if not all(isinstance(path, RestPath) for path in scenario.carrier_paths.values()):
        return None, "not computed: carriers have time laws of their own"
    if scenario.wind_set is not None:
        return None, "not computed: in moving air the drag is not proportional to the square of the speed"
    if has_own_law(scenario):
        return None, f"not computed: the path of kind {task.path.kind} has a time law of its own"
    hard = {name: getattr(task.limits, name) for name in WITHOUT_POWER if name not in task.limits.soft}
    alone = {"limits": TaskLimits(**hard), "margin": scenario.hard_margin, "tube": Tube(), "stop_within": None}
    try:
        found = time_along(scenario.robot, task.model_copy(update=alone))
    except (InputError, SolverError) as error:
        return None, f"not computed: {str(error).removeprefix('time_along: ')}"
    if found.feasible:
        return found, f"the fastest time law takes {quantity(found.duration, 's', 6)}"
    at = 0.0 if found.law is None else found.law.at or 0.0
    return found, f"{found.status.value} at {quantity(100 * at, '%', 3)} of the path"


def has_own_law(scenario: Scenario) -> bool:
    """Return whether no other time law is chosen for a path."""
    path = scenario.task.path
    own = path.natural_duration is not None or getattr(path, "timing", "") == "uniform"
    return own or not isinstance(path, LinePath | WaypointPath)


def audit_of_law(law: Plan, scenario: Scenario) -> Audit | None:
    """Return the audit of the fastest law if it is one of all limits of the scenario, else None."""
    task = scenario.task.model_copy(update={"path": law.scenario.task.path, "duration": None})
    return law.audit if task == law.scenario.task else None
