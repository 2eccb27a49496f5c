"""`Row`: the results of one plan in the table of a sweep; `plan_case` computes it, in any process."""

import math
import time
from pathlib import Path
from typing import NamedTuple

from ...base import processors
from ...base.errors import TowlineError
from ...base.inputs import printable
from ...models import Robot
from ..audits.violation import cost
from ..plan import Plan
from ..planner import plan
from ..reports.report import decisive
from ..tasks.task import Task

FAILED = "failed"  # the status of a plan that ended with an error, besides those of `MotionStatus`


class Row(NamedTuple):
    """The results of one plan in the table of a sweep; missing numbers are nan."""

    status: str  # see `MotionStatus`; or `failed` if planning raised an error
    reason: str  # why it is not feasible, in one line; empty if it is
    cost: float  # the task's objective, for a feasible plan
    duration: float  # [s]
    margin: float  # smallest distance of any tension from its limits [N]
    tension_max: float  # largest [N]
    iterations: int  # of the last run of the solver
    seconds: float  # wall time to plan [s]


_NO_PLAN = Row(FAILED, "", math.nan, math.nan, math.nan, math.nan, iterations=0, seconds=0.0)


def plan_case(number: int, robot: Robot, task: Task, file: Path | None) -> tuple[int, Row]:
    """Plan a combination with one processor and save the plan, unless `file` is None; return its number and its row.

    Raises `InputError` if the file cannot be written. An error of planning is a row.
    """
    start = time.perf_counter()
    try:
        with processors.at_most(1):
            planned = plan(robot, task)
            row = _row(planned)
    except Exception as error:  # a sweep of a night must not end because of one plan
        line = str(error) if isinstance(error, TowlineError) else f"{type(error).__name__}: {error}"
        return number, _NO_PLAN._replace(reason=printable(line), seconds=time.perf_counter() - start)
    seconds = time.perf_counter() - start
    if file is not None:
        planned.save(file)
    return number, row._replace(seconds=seconds)


def _row(planned: Plan) -> Row:
    """Return the row of a plan; its cost, where no program was solved, is computed from the audited tensions."""
    least, largest = (math.nan if value is None else value for value in (planned.margin, planned.tension_max))
    duration, iterations = planned.scenario.duration, planned.iterations
    reason, objective = ("", planned.objective) if planned.feasible else (decisive(planned), math.nan)
    objective = cost(planned) if objective is None else objective
    return Row(planned.status.value, reason, objective, duration, least, largest, iterations, 0.0)
