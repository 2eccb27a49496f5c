"""`Cases`: robot and task of each plan of a sweep; `Row`: its results in the table, computed in any process."""

import math
import time
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...base import processors
from ...base.errors import InputError, TowlineError
from ...base.inputs import printable
from ...models import Robot
from ...models.files import as_robot
from ...models.parameters import locate
from ...models.parsing import validate
from ...models.uncertainty import Uncertainty
from ..audits.violation import cost
from ..plan import Plan
from ..planner import plan
from ..reports.report import decisive
from ..tasks.lay_out import lay_out
from ..tasks.task import Task, read_task
from .axis import Axis

CUT = "cut"  # as a cable's t_max: the robot is without this cable
FAILED = "failed"  # the status of a plan that ended with an error, besides those of `MotionStatus`


def _data_of(task: Task) -> dict[str, Any]:
    """Return the fields of a task that are set, as a mapping."""
    data = task.model_dump(exclude_unset=True)
    for key, own in (("limits", task.limits.own), ("objective", task.objective.own)):
        if own:
            data.setdefault(key, {})["own"] = own
    return data


def _without_cut_cables(data: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the data of a robot without the cables that are cut; its uncertainty names the others by new numbers."""
    kept = [i for i, one in enumerate(data["cables"]) if not (isinstance(one, dict) and one.get("t_max") == CUT)]
    data = {**data, "cables": [data["cables"][i] for i in kept]}
    if data.get("uncertainty") is None:
        return data
    known, numbers = validate(data["uncertainty"], Uncertainty, f"robot {name!r}: uncertainty"), {}
    for row, parameter in enumerate(known.parameters):
        if (cable := locate(parameter).cable) in kept:
            numbers[row] = parameter.replace(f"[{cable}]", f"[{kept.index(cable)}]")
    rows = list(numbers)
    covariance = known.matrix[np.ix_(rows, rows)].tolist()
    data["uncertainty"] = {"parameters": list(numbers.values()), "covariance": covariance} if rows else None
    return data


class Cases:
    """The combinations of values of `axes`, numbered from 0 with the last axis fastest.

    `robot` and `task` are those without variation, `shape` has the number of values of each axis.
    """

    def __init__(self, robot: Robot, task: Task, axes: tuple[Axis, ...]):
        self.robot, self.task, self.axes = robot, task, axes
        self.shape = tuple(len(axis.values) for axis in axes)
        self.wholes: dict[str, list[Any]] = {}  # robots and tasks that are values, by "robot" and "task"
        for axis in axes:
            if axis.field.whole:
                read = as_robot if axis.field.of_robot else read_task
                self.wholes[axis.field.key] = [read(value) for value in axis.values]
        self._data = {id(each): _data_of(each) for each in (task, *self.wholes.get("task", ()))}
        self._robots: dict[tuple[int, ...], Robot] = {}

    @property
    def title(self) -> str:
        """Return the names of robot and task, or how many there are."""
        names = {"robot": self.robot.name, "task": self.task.name}
        return ", ".join(f"{len(self.wholes[key])} {key}s" if key in self.wholes else names[key] for key in names)

    def __len__(self) -> int:
        """Return the number of combinations."""
        return prod(self.shape)

    def places(self, number: int) -> list[tuple[Axis, int]]:
        """Return each axis with the index of its value in a combination."""
        indices = np.unravel_index(number, self.shape)
        return [(axis, int(index)) for axis, index in zip(self.axes, indices, strict=True)]

    def described(self, number: int) -> str:
        """Return the values of a combination as text: "margin = 5, duration = 4"."""
        return ", ".join(f"{axis.field.key} = {axis.texts[index]}" for axis, index in self.places(number))

    def case(self, number: int) -> tuple[Robot, Task]:
        """Return robot and task of a combination, validated like a robot and task file.

        Raises `InputError` if the values are not valid.
        """
        places = self.places(number)
        task = self._whole("task", self.task, places)
        data = self._data[id(task)]
        parts = [(axis, index) for axis, index in places if not (axis.field.of_robot or axis.field.whole)]
        for axis, index in parts:
            data = axis.field.set(data, axis.values[index])
        task = validate(data, Task, f"task {task.name!r}") if parts else task
        return self._robot([place for place in places if place[0].field.of_robot]), task

    def _whole(self, key: str, own: Any, places: list[tuple[Axis, int]]) -> Any:
        """Return the robot or the task of a combination, before parts of it vary."""
        return next((self.wholes[key][index] for axis, index in places if axis.field.key == key), own)

    def _robot(self, varied: list[tuple[Axis, int]]) -> Robot:
        robot = self._whole("robot", self.robot, varied)
        parts, place = [each for each in varied if not each[0].field.whole], tuple(index for _, index in varied)
        if parts and place not in self._robots:
            data: Any = robot.model_dump(exclude_unset=True)
            for axis, index in parts:
                data = axis.field.set(data, axis.values[index])
            if any(axis.values[index] == CUT for axis, index in parts):  # last, since the numbers of the others change
                data = _without_cut_cables(data, robot.name)
            self._robots[place] = validate(data, Robot, f"robot {robot.name!r}")
        return self._robots[place] if parts else robot

    def check(self) -> None:
        """Check every combination: whether the values are valid and the task fits the robot.

        Raises `InputError` for the first one that is wrong, with its values. If whole robots or tasks vary, it is
        enough that one of the tasks fits its robot: the other combinations are rows with the status `failed`.
        """
        wrong: list[InputError] = []
        for number in range(len(self)):
            try:
                case = self.case(number)
            except InputError as error:
                raise InputError(f"{error} (with {self.described(number)})") from None
            try:
                lay_out(*case)
            except InputError as error:
                wrong.append(InputError(f"{error} (with {self.described(number)})"))
            if wrong and (not self.wholes or len(wrong) == len(self)):
                raise wrong[0]

    def units(self) -> tuple[str, ...]:
        """Return the unit of each varied field; empty without a unit."""
        robot, task = self.case(0)
        return tuple(axis.field.unit(robot if axis.field.of_robot else task) for axis in self.axes)


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
