"""`sweep`: plan a task for all combinations of some values, on processes or a cluster, with resumption."""

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from ...base.checkpoint import Kind
from ...base.inputs import InputError, file_path
from ...base.version import __version__
from ...base.writing import check_writable
from ...models import Robot
from ...models.files import AnyRobot, as_robot
from ..tasks.task import MotionStatus, Task, read_task
from .axis import read_axes
from .cases import Cases, Row, plan_case
from .result import Sweep

KIND = Kind("sweep", "plan")  # a result is a row as JSON, in which floats keep every bit

Progress = Callable[[int, int, int], None]


def sweep(
    robot: AnyRobot,
    task: Task | dict[str, Any] | str | os.PathLike[str],
    vary: Mapping[str, Iterable[Any]],
    *,
    workers: int = 1,
    scheduler: str | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    resume: bool = False,
    keep: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Plan a task for all combinations of some values of its fields.

    Each plan starts from the planner's guess, so no plan depends on another. All combinations are checked before the
    first is planned. An infeasible plan is a valid result; a plan that raises an error is a row with the status
    `failed`.

    Except for wall times, the table does not depend on the number of workers, as long as no plan is stopped by its
    `time_limit`. Processes use one thread each. With `workers=1` set `OMP_NUM_THREADS` to 1 before towline is imported
    for the same result, because with more threads the last digits of some plans differ.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        task: A `Task`, a mapping with its keys, or the path of a YAML file.
        vary: Lists of values by dotted keys of a task file: `{"margin": [0, 5, 10], "scheme": ["linear", "spline"]}`.
            Keys that begin with `robot.` are keys of the robot file: `robot.platform.mass`. Items of lists are numbered
            from 0, `limits.keep_out[0].radius`; a key without a number means all items, `robot.cables.t_max`. A cable
            whose `t_max` is "cut" is left out of the robot. The keys `robot` and `task` vary the whole robot or task:
            names or files. If a task does not fit a robot, the row is `failed`.
        workers: Number of processes on this machine, with one thread each; 1: this process.
        scheduler: Address of a Dask scheduler whose workers are used instead (extra `cluster`).
        checkpoint: File to which each plan's row is appended as soon as it is computed.
        resume: True to continue the checkpoint if the file exists. It must belong to the same sweep.
        keep: Folder in which to save every plan as NetCDF, named by its number; default: plans are not saved.
        progress: Function that is called with (plans done, plans in total, plans feasible).

    Returns:
        Sweep: The table of all plans; it can be saved and drawn.

    Raises:
        InputError: Before anything is planned, if an argument or a combination of values is wrong, the checkpoint
            cannot be written, is damaged or belongs to another sweep, or the scheduler does not exist. Later, if the
            checkpoint or a plan of `keep` can no longer be written; the checkpoint can be resumed.
        SolverError: If workers end before their work is done, or the extra `cluster` is not installed.
    """
    from ...base.execution import Execution, started  # imports as long as a short plan takes

    where = Execution(workers, scheduler, checkpoint, resume, progress)
    folder = None if keep is None else file_path("keep", keep, "a path or None").resolve()
    cases = Cases(as_robot(robot), read_task(task), read_axes(vary))
    cases.check()
    if folder is not None:
        try:
            check_writable(plan_file(folder, cases, 0))
        except InputError as error:
            raise InputError(f"keep: {error}") from None
    rows, tell = dict[int, Row](), progress or (lambda *_: None)
    with started(where, KIND, lambda: _header(cases, folder)) as (working, stored):
        if stored is not None:
            rows.update((number, Row(*json.loads(content))) for number, content in stored.items())
        feasible = sum(row.status == MotionStatus.FEASIBLE for row in rows.values())
        tell(len(rows), len(cases), feasible)
        for number, row in working.map(plan_case, _jobs(cases, set(rows), folder), in_order=False):
            if stored is not None:
                stored.put(number, json.dumps(row).encode())
            rows[number] = row
            feasible += row.status == MotionStatus.FEASIBLE
            tell(len(rows), len(cases), feasible)
    return Sweep(cases, tuple(rows[number] for number in range(len(cases))))


def plan_file(folder: Path, cases: Cases, number: int) -> Path:
    """Return the file in which a plan is saved."""
    return folder / f"plan-{number:0{len(str(len(cases) - 1))}}.nc"


def _jobs(cases: Cases, known: set[int], folder: Path | None) -> Iterator[tuple[Any, ...]]:
    """Yield the arguments of `plan_case` for the plans that are not known yet."""
    for number in range(len(cases)):
        if number not in known:
            yield number, *cases.case(number), None if folder is None else plan_file(folder, cases, number)


def _header(cases: Cases, folder: Path | None) -> dict[str, Any]:
    """Return everything on which the rows depend."""
    robot, task = cases.robot, cases.task
    versions = {"towline": __version__, "casadi": ca.CasadiMeta.version(), "numpy": np.__version__}
    return {
        "robot": f"{robot.name} {_digest(_content(robot))}",
        "task": f"{task.name} {_digest(_content(task))}",
        "limits.own": [limit.name for limit in task.limits.own],
        "objective.own": [f"{cost.name} {cost.amount}" for cost in task.objective.own],
        "order of vary": [axis.field.key for axis in cases.axes],
        **{f"vary {axis.field.key}": list(axis.values) for axis in cases.axes},
        **{f"values of {key}": [_digest(_content(each)) for each in its] for key, its in cases.wholes.items()},
        "keep": folder is not None,
        **versions,
    }


def _content(each: Robot | Task) -> dict[str, Any]:
    """Return all numbers of a robot or a task."""
    return (each.in_file() if isinstance(each, Task) else each).model_dump(mode="json")


def _digest(data: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]
